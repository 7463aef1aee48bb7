// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/anatomy_registration.hpp"
#include "angio/evaluation/case_run.hpp"

namespace angio {

/// For a person: T_dsa_cb, the runs' shifts, each view against the others. `left_out` names those that were not
/// registered.
std::string anatomyTable(const AnatomyResult& result, const std::vector<CaseOutcome>& outcomes,
                         const std::string& left_out);

/// The views that took part, in one order, and the tree; a view from a centreline has no image.
struct ReportedAnatomy {
  const std::vector<AnatomyView>& views;
  const std::vector<SeenAnatomy>& seen;
  const std::vector<std::optional<std::string>>& image_paths;
  const VesselTree& tree;
};

/// Each view's overlay and how far it is from the others, as pictures and a page with `table`.
void writeAnatomyReport(const std::string& folder, const std::string& cases_path, const AnatomyResult& result,
                        const ReportedAnatomy& anatomy, const std::string& table);

}  // namespace angio

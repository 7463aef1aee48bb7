// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/results/case_run.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::apps {

/// The DICOM files that angio-register writes for other systems.
struct DicomOutputs {
  std::string registration, overlay, frame_of_reference;

  void addTo(cli::Command& app);
  bool given() const { return !registration.empty() || !overlay.empty(); }

  /// Writes the pose of a result that converged, and the picture of any. @param run_path  The image of the first view;
  /// empty: none. Throws InputError that names the file.
  void write(const VesselTree& tree, const std::string& method, const CaseOutcome& outcome, const std::string& run_path,
             const std::function<cv::Mat()>& picture) const;
};

}  // namespace angio::apps

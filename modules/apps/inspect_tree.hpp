// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "findings.hpp"

namespace angio::apps {

/// What a file holds, and what stands below it.
struct Inspected {
  Findings found;
  std::string table = {};
};

/// A vessel tree's file or folder, and what is wanted of it: a picture of its branches when `picture` is not empty,
/// with the patient's axes by the C-arm file `calibration`, and their table among the findings or, without `json`, as
/// text.
struct TreeToInspect {
  std::string file, picture, calibration;
  bool json = false;
};

/// Says what a vessel tree holds, and draws its branches. Throws InputError.
Inspected inspectTree(const TreeToInspect& o);

}  // namespace angio::apps

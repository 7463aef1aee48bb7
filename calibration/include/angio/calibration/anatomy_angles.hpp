// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/namespace.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::calibration {

/// What the C-arm said of one view.
struct AnatomyAngles {
  std::string name;  ///< Of the case.
  std::string run;   ///< The name, when nobody said.
  CArmJoints joints = CArmJoints::Zero();
  std::optional<double> source_isocenter_distance_m;
};

/// Angles of a case set's views.
struct AnatomyAngleSet {
  std::string machine;  ///< Empty when the file does not say.
  std::vector<AnatomyAngles> views;
};

/// Reads angles:
///
///     machine: lab-1                        # optional
///     source_isocentre_distance_mm: 720     # optional with a C-arm file; a view may have its own
///     views:
///       - name: "im1"                       # of the case
///         primary_deg: 31.3                 # DICOM (0018,1510): + is LAO
///         secondary_deg: 0.1                # DICOM (0018,1511): + is CRA
///         table_mm: [0, 0, 0]               # optional
///         run: "1"                          # optional: views of one run share the isocentre
///
/// Throws InputError that names file, line, key, value and rule.
AnatomyAngleSet readAnatomyAngles(const std::string& path);

/// The same of a DICOM run's frame. Throws InputError when its attributes do not tell.
AnatomyAngles dicomAngles(const std::string& name, const std::string& path, int frame = 0);

}  // namespace angio::calibration

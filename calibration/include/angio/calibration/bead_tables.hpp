// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"

namespace angio::calibration {

/// Reads beads seen in one view, a row each (CSV): `x_px`, `y_px`, and optionally `std_px` (1 when it is not there),
/// `radius_px`, `contrast` and `bead`, its number in the phantom. Throws InputError that names file, line, field, value
/// and rule; numbers are given for all beads or for none.
std::vector<BeadDetection> readBeadTable(const std::string& path);

/// Writes what readBeadTable reads. Throws InputError when the file cannot be written.
void writeBeadTable(const std::string& path, const std::vector<BeadDetection>& beads);

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>

#include "angio/calibration/bead_phantom.hpp"

namespace angio::calibration {

/// Another bead that stands where a bead comes to stand when the phantom is turned or mirrored onto itself.
struct BeadSymmetry {
  int bead = 0, image = 0;
  bool mirrors = false;
};

/// The first movement, or mirroring, that puts every bead within `tolerance_m` of one of its size; nothing if there is
/// none but to leave the phantom where it is.
std::optional<BeadSymmetry> symmetryOf(const BeadPhantom& phantom, double tolerance_m);

}  // namespace angio::calibration

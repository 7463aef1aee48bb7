// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/calibration/bead_phantom.hpp"

namespace angio::calibration {

/// A movement, or a mirroring, that puts every bead of a phantom onto one of its size.
struct PhantomSymmetry {
  bool mirrors = false;
  std::vector<int> image;  ///< Where each bead comes to stand: the number of the bead there.
};

/// The symmetries of a phantom, to within a tolerance; the first leaves every bead where it is. No more than `most`.
/// Sizes count as equal when they differ by a fifth at most, which is what an image cannot tell apart for sure.
std::vector<PhantomSymmetry> symmetriesOf(const BeadPhantom& phantom, double tolerance_m, std::size_t most = 1000);

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/namespace.hpp"

namespace angio::calibration {

/// Shifts of a phantom's plates against where its file has them, x, y, z of each plate in the phantom's frame [mm].
struct PlateShifts {
  Eigen::VectorXd mean_mm;         ///< 3 numbers a plate.
  Eigen::MatrixXd covariance_mm2;  ///< As many rows and columns.
};

/// A phantom that is made of plates: beads of one plate stand as the file says against each other, plates may be
/// shifted. Without plates the phantom is of one piece.
struct PhantomPlates {
  std::vector<int> plate_of_bead;  ///< One a bead; empty: of one piece.
  Eigen::Index count = 0;
  PlateShifts known;  ///< Before anything was seen.

  bool isOnePiece() const { return count == 0; }
};

/// The plates of a phantom that is stacked along an axis (0 to 2) of its frame: beads share a plate where no gap of 2
/// mm along the axis parts them. The shifts are zero with a standard deviation of `tolerance_mm` per axis and plate. Of
/// one piece when there would be fewer than two or more than eight plates, or one of fewer than four beads.
PhantomPlates platesAlong(const BeadPhantom& phantom, int axis, double tolerance_mm);

/// What two estimates, whose errors are independent apart from the common `known`, say together of the shifts.
PlateShifts jointShifts(const PlateShifts& known, const PlateShifts& one, const PlateShifts& other);

}  // namespace angio::calibration

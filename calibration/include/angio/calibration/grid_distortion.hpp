// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/calibration/hole_grid.hpp"
#include "angio/geometry/distortion.hpp"

namespace angio::calibration {

/// A detector's distortion by the image of a regular grid on it.
struct GridDistortion {
  DetectorDistortion distortion;      ///< Of the polynomial model.
  int order = 0;                      ///< Chosen by holes that took no part in the fit.
  std::vector<double> choice_rms_px;  ///< Of those holes, by order from 1.

  int found = 0, used = 0;            ///< Holes with a place in the grid; those of the final fit.
  std::vector<std::size_t> outliers;  ///< Whole holes that no smooth map explains, by their places in the grid's list.
  double noise_px = 0;                ///< Standard deviation of a hole's centre per axis, as measured.
  double residual_rms_px = 0;         ///< Of the distance, over the holes of the final fit.
  double held_out_rms_px = 0, held_out_max_px = 0;  ///< Of holes that neither the fit nor the order's choice has seen.
  int held_out = 0;
  double displacement_rms_px = 0, displacement_max_px = 0;  ///< Of the used holes from the regular grid.
  Eigen::Matrix2Xd residuals_px;                            ///< Mapped less seen, one column a hole of the grid.

  /// Of each axis' coefficients, in the order of the terms; the axes' errors are independent [px^2].
  Eigen::MatrixXd term_covariance_px2;

  /// Standard deviation per axis of where the map puts a pinhole pixel [px]; within the circle of holes.
  double std_px(const Eigen::Vector2d& pinhole_px) const;
};

/// Fits the map from a regular grid to the holes as seen: a polynomial over the circle of the holes, continued outside.
/// Holes that the rim or the image's edge cuts take no part, as their centres are not seen.
///
/// Half of the holes are fitted, a quarter chooses the order (the lowest within 2 per cent of the best), a quarter is
/// held out and reported; then all are fitted. Where the regular grid lies is not known: the similarity is taken that
/// is nearest to the image, in least squares over the whole holes. Scale, turn and shift of the pinhole image are
/// thereby a choice, and so are the focal length's unit, the principal point's origin and the camera's turn about its
/// axis; the source's place relative to what it sees is not.
///
/// Throws InputError that begins with `place` when fewer than 100 holes are whole, when more than a twentieth of them
/// are outliers, and when the map folds.
GridDistortion fitGridDistortion(const std::string& place, const HoleGrid& grid);

}  // namespace angio::calibration

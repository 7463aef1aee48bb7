// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "angio/calibration/camera_calibration.hpp"

namespace angio::calibration {

/// All a lens may have: fx, fy, cx, cy, skew [px], k1, k2, s1, s2 [rad], offset of the distance's encoder [m], motion
/// of the principal point with the distance (x, y) [px/m].
enum LensNumber { kFx, kFy, kCx, kCy, kSkew, kK1, kK2, kS1, kS2, kOffset, kSlopeX, kSlopeY, kLensNumbers };
using LensNumbers = Eigen::Matrix<double, kLensNumbers, 1>;

/// How those numbers make an image.
struct LensModel {
  LensKind kind = LensKind::kNone;
  Eigen::Vector2d middle_px{0, 0};  ///< Of the detector.
  double half_width_px = 1;
  double reference_distance_m = 1;  ///< Source-detector distance of fx to cy, by the encoder.

  /// Where a point in front of the camera is seen, at a source-detector distance; with derivatives by point and lens.
  Eigen::Vector2d seen(const LensNumbers& lens, double distance_m, const Eigen::Vector3d& p_camera,
                       Eigen::Matrix<double, 2, 3>* J_point = nullptr,
                       Eigen::Matrix<double, 2, kLensNumbers>* J_lens = nullptr) const;
};

/// The free ones among the numbers, in the units of their names: lens = fixed + map * parameters.
struct LensParameters {
  std::vector<std::string> names;  ///< "fx_px", "s1_deg", "source_detector_offset_mm".
  Eigen::MatrixXd map;             ///< kLensNumbers x names.
  LensNumbers fixed = LensNumbers::Zero();

  LensNumbers lens(const Eigen::VectorXd& parameters) const { return fixed + map * parameters; }
};
LensParameters freeParameters(const CameraCalibrationSettings& settings, bool several_distances);

}  // namespace angio::calibration

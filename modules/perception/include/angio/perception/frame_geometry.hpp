// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "angio/geometry/carm.hpp"
#include "angio/perception/namespace.hpp"

namespace angio::perception {

/// Returns what contradicts the geometry that a frame says of itself, with both numbers; nothing where all agree.
///
/// Focal lengths, pixel spacing and source-detector distance have to agree with each other and with the calibration
/// within 1 %, the principal point within 0.5 mm at the isocentre: in depth, 1 % is 8 mm. A detector that has been
/// moved along the beam, a window of it, and pixels that are binned are no contradiction. What a frame does not say (0
/// in xray_frame_t) is taken from the calibration.
///
/// @param said  The frame's camera. @param calibrated  The C-arm.
std::optional<std::string> contradiction(const XrayCamera& said, const CArmGeometry& calibrated);

/// Notices a focal length that many frames contradict, though frames and calibration agree on it: what is seen larger
/// than it is seems nearer in every view, while a patient who lies elsewhere seems nearer in some and further in
/// others.
///
/// Model: along the beam b of a view, the tree's depth in the registration is off that by joints and calibration by
/// b . t + kappa Z, with the patient's offset t, kappa = f_said / f - 1, and Z the distance from the source. Linear
/// least squares over views at least 2 deg apart, with t of 20 mm and kappa of 10 % beforehand.
class FocalLengthMonitor {
 public:
  /// Relative error of the frames' focal length, and its standard deviation.
  struct Estimate {
    double error = 0;  ///< kappa: 0.03 where frames say a focal length that is 3 % too long.
    double std = 0;
  };

  /// @param beam_patient  The view's beam, a unit vector. @param depth_off_m  Registered less expected depth.
  /// @param depth_m  Expected depth, > 0.
  void see(const Eigen::Vector3d& beam_patient, double depth_off_m, double depth_m);

  Estimate estimate() const;

  /// What to tell, once the error exceeds 1 % by three standard deviations; nothing before.
  std::optional<std::string> warning() const;

 private:
  Eigen::Matrix4d information_ = Eigen::Vector4d(1 / (20e-3 * 20e-3), 1 / (20e-3 * 20e-3), 1 / (20e-3 * 20e-3), 100)
                                     .asDiagonal();  // Of (t, kappa).
  Eigen::Vector4d pull_ = Eigen::Vector4d::Zero();
  Eigen::Vector3d last_beam_ = Eigen::Vector3d::Zero();
};

}  // namespace angio::perception

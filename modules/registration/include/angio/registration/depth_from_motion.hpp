// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "angio/registration/registration.hpp"

namespace angio::registration {

/// A frame that was registered while the camera moved.
struct MovingFrame {
  std::shared_ptr<const FrameEvidence> evidence;  ///< RegistrationResult::evidence of it.
  Pose T_camera_patient = Pose::Identity();       ///< By joints and calibration: where the camera was.
  double time_s = 0;                              ///< Of the exposure.
};

/// Where a tree is in the newest of several frames, by all of them.
struct DepthFromMotion {
  /// Of the newest frame: pose, displacements, covariance, what is known of points, agreement with that frame, and the
  /// status that these give.
  RegistrationResult registration;
  double turn_rad = 0;                             ///< Largest angle between two of the frames' beams.
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();  ///< Of that turn, unit, patient axes.
  int frames = 0;                                  ///< That took part.
  double patient_motion_m = 0;  ///< How far the patient moved along the axis of the turn, rms over the frames.
  double unexplained_m = 0;     ///< How far each frame is off for itself, per axis, by the residuals.
};

/// Finds where the tree is in depth by frames that were taken while the C-arm turned: one problem over one pose, one
/// deformation, a motion of the patient that all frames share, and one shift of each frame for itself.
///
/// The place of the camera in each frame is taken as exact: 0.1 mm that two places are wrong against each other is 1 mm
/// in depth over 6 deg, which the covariance does not count. What moves the patient, as the breath does, is read off
/// the shift of the frames along the axis of the turn, in which depth has no part: across it, and at each place of the
/// tree, the patient may move by anything smooth that goes with it, or with it up to 0.4 s later or 0.1 s sooner. What
/// the breath is between frames, before the first and after the last is regressed; its uncertainty is in the claims.
/// How far frames are off for themselves is found from the residuals. Linear about what the frames' own fits have
/// matched, twice. A tree that is deformed by millimetres is then found again across the newest frame's beam, where
/// that explains more of it. A place that lies beside its image there is claimed less. The displacements hold the
/// patient's shift, which is no deformation to the status.
///
/// @param frames  By time, the newest last; those without evidence are left out.
/// @param newest  What the newest frame shows.
/// @param prior   Of the pose in the newest frame, by calibration.
/// @param tree    The tree that was registered.
/// Returns nothing when fewer than kMinTurnFrames are left, the beams differ by less than kMinBeamTurn_rad, or the
/// system has no solution.
std::optional<DepthFromMotion> depthFromMotion(const std::vector<MovingFrame>& frames, const XrayView& newest,
                                               const PosePrior& prior, const VesselTree& tree);

constexpr int kMinTurnFrames = 4;
constexpr std::size_t kMaxTurnFrames = 32;  ///< Of more, as many take part.
constexpr double kMinBeamTurn_rad = 0.01;   ///< 0.6 deg: 1 mm in depth is 0.01 mm across the beam.

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/geometry_calibration.hpp"
#include "angio/calibration/pose_set.hpp"

namespace angio::calibration {

/// Changes of a view that its beads tell of: a twist of the phantom in the camera [m, rad], camera axes, from the left,
/// then fx, fy, cx, cy [px].
constexpr int kViewChanges = 10;
using ViewChange = Eigen::Matrix<double, kViewChanges, 1>;

/// A view condensed about its best pose: |residuals|^2 = |upper * change + offset|^2 + what no change explains.
/// Residuals are beads' [px], or a registered pose's by its covariance [standard deviations].
struct ViewObservation {
  std::string name;
  CArmJoints joints = CArmJoints::Zero();
  double source_detector_distance_m = 0;
  bool held_out = false;
  int beads = 0;                                        ///< Used; none in a registered view.
  std::vector<int> far_beads;                           ///< Not used: further off than the rest can explain.
  Eigen::Vector4d camera_px = Eigen::Vector4d::Zero();  ///< fx, fy, cx, cy that changes count from.
  Pose T_camera_phantom = Pose::Identity();             ///< The pose that they count from.
  Eigen::Matrix<double, kViewChanges, kViewChanges> upper = Eigen::Matrix<double, kViewChanges, kViewChanges>::Zero();
  ViewChange offset = ViewChange::Zero();
  double unexplained_px2 = 0;  ///< Sum of squares that no pose explains.
};

/// Finds a view's pose with the camera as it is at its distance, robustly. Throws InputError at `place` and the view's
/// name for fewer than 8 beads and for beads that no pose explains.
ViewObservation observeView(const std::string& place, const BeadPhantom& phantom, const XrayCamera& camera,
                            const GeometryView& view, double outlier_std);

/// A registered pose as such a view: it says nothing of the camera. `usual` stands in for a covariance that is not
/// given; without either the pose is taken as exact to 1 um and 1e-6 rad, and its scatter is left to be measured.
ViewObservation observePose(const HandEyePose& pose, const std::optional<PoseSigma>& usual);

/// Throws InputError when beads lie elsewhere than the phantom says in half of the views or more: swapped labels.
void requireSoundBeads(const std::string& place, const BeadPhantom& phantom, const std::vector<GeometryView>& views,
                       const std::vector<ViewObservation>& seen);

}  // namespace angio::calibration

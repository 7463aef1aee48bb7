// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/carm.hpp"
#include "angio/servo/namespace.hpp"

namespace angio::servo {

/// A view of the anatomy: beam angles in the patient's own axes, and the point of the model that shall lie at the
/// isocentre.
struct DesiredView {
  ViewAngles angles;  ///< LAO/CRA positive, of the anatomy, not of the examination room.
  Eigen::Vector3d target_model = Eigen::Vector3d::Zero();     ///< [m].
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();  ///< Patient axes L, P, S from the model's axes.
};

/// cdMo: the model in the camera when the view is reached, head up in the image.
Pose desiredPose(const DesiredView& view, double source_isocenter_distance_m);

/// How far a pose is from a view.
struct ViewError {
  double direction_rad = 0;  ///< Angle between the beams, seen from the anatomy: what two C-arm angles can mend.
  double roll_rad = 0;  ///< Turn of the image about the beam: no joint of a C-arm without detector rotation mends it.
  double target_m = 0;  ///< Distance of the target from its desired place, in the camera frame.
};
ViewError viewError(const Pose& T_camera_model, const Pose& desired_T_camera_model,
                    const Eigen::Vector3d& target_model);

}  // namespace angio::servo

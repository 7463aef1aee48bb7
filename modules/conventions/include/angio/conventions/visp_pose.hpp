// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/conventions/xray_projection.hpp"

namespace angio::conventions {

/// ViSP's cMo as translation and theta u, and vpCameraParameters without distortion. Its frames are ours: z from the
/// source to the detector, x right and y down in the picture, pixel (0, 0) the middle of the first one. Source: classes
/// vpPoseVector, vpThetaUVector and vpCameraParameters of ViSP.
struct VispProjection {
  Eigen::Vector3d t_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d thetau_deg = Eigen::Vector3d::Zero();
  double px = 0, py = 0, u0 = 0, v0 = 0;
  XrayCamera::Parameters detector;  ///< Size and, when known, pixel and distance: not part of ViSP's parameters.
};

/// Throws InputError by the rules of XrayCamera.
XrayProjection fromVispPose(const VispProjection& theirs);
VispProjection toVispPose(const XrayProjection& ours);

}  // namespace angio::conventions

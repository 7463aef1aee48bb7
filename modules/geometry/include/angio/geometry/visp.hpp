// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <visp3/core/vpCameraParameters.h>
#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpMatrix.h>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"

namespace angio::geometry {

/// T_a_b as ViSP's aMb. Metres on both sides.
vpHomogeneousMatrix toVisp(const Pose& T);

/// ViSP's aMb as T_a_b. Throws InputError when the rotation is none (ViSP itself accepts any matrix).
Pose fromVisp(const vpHomogeneousMatrix& M);

/// Any Eigen matrix as vpMatrix.
vpMatrix toVisp(const Eigen::Ref<const Eigen::MatrixXd>& M);

/// ViSP's perspective camera without distortion: px, py, u0, v0.
vpCameraParameters toVisp(const XrayCamera& camera);

/// The X-ray camera of ViSP's parameters; the image size is not part of them. Throws InputError on distortion, which a
/// caller must correct first, and on the rules of XrayCamera.
XrayCamera fromVisp(const vpCameraParameters& parameters, int width_px, int height_px);

}  // namespace angio::geometry

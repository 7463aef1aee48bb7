// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/xray_projection.hpp"

#include "checks.hpp"

namespace angio::conventions {

Eigen::Vector3d sourceInModel(const XrayProjection& projection) {
  return projection.T_camera_model.inverse().translation();
}

Eigen::Matrix4d detectorInModel(const XrayProjection& projection) {
  const XrayCamera::Parameters& p = projection.camera.parameters();
  const double distance_m = 1e-3 * requireSourceDetector_mm(projection.camera, "the detector's place");
  Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
  M(0, 0) = distance_m / p.fx_px;
  M(1, 1) = distance_m / p.fy_px;
  M.topRightCorner<3, 1>() = distance_m * projection.camera.ray(Eigen::Vector2d::Zero());
  return projection.T_camera_model.inverse().matrix() * M;
}

}  // namespace angio::conventions

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/tip_on_ray.hpp"

namespace angio::localisation {

Eigen::Vector3d tipOnRay(const TipPlace& place, const SeenCatheter& seen, const SeenPose& pose) {
  if (seen.tip_end != TipEnd::kLast || seen.points_px.cols() == 0) return place.tip_model;
  const Eigen::Vector3d ray = pose.camera.ray(seen.points_px.rightCols<1>()).normalized();
  const Eigen::Vector3d on_axis = pose.T_camera_model * place.tip_model;
  return pose.T_camera_model.inverse() * Eigen::Vector3d(ray.dot(on_axis) * ray);
}

}  // namespace angio::localisation

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/world_frame.hpp"

namespace angio::conventions {

Pose T_world_model(const WorldFrame& frame, WorldAxes axes) {
  Eigen::Matrix3d R_world_lps = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d R_lps_ras = Eigen::Vector3d(-1, -1, 1).asDiagonal();
  if (axes == WorldAxes::kRas) R_world_lps = R_lps_ras;
  if (axes == WorldAxes::kIec) R_world_lps << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  Pose T = Pose::Identity();
  if (frame.model_axes == ModelAxes::kLps) T.linear() = R_world_lps;
  if (frame.model_axes == ModelAxes::kRas) T.linear() = R_world_lps * R_lps_ras;
  T.translation() = -1e-3 * (T.linear() * frame.isocenter_mm);
  return T;
}

}  // namespace angio::conventions

// SPDX-License-Identifier: GPL-2.0-or-later
#include <Eigen/Cholesky>

#include "geometry_observation.hpp"

namespace angio {
namespace {

constexpr double kExact_m = 1e-6, kExact_rad = 1e-6;

// Of a place [m] and a turn about the object's origin [rad], camera axes.
Matrix6d placeCovariance(const HandEyePose& pose, const std::optional<PoseSigma>& usual) {
  if (pose.covariance) return *pose.covariance;
  const double translation_m = std::max(usual ? usual->translation_m : 0, kExact_m),
               rotation_rad = std::max(usual ? usual->rotation_rad : 0, kExact_rad);
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(translation_m * translation_m),
      Eigen::Vector3d::Constant(rotation_rad * rotation_rad);
  return variances.asDiagonal();
}

}  // namespace

ViewObservation observePose(const HandEyePose& pose, const std::optional<PoseSigma>& usual) {
  ViewObservation seen;
  seen.name = pose.name;
  seen.joints = pose.joints.value();
  seen.T_camera_phantom = pose.T_camera_object;
  // A twist turns about the camera: exp(v, w) T has its origin at t + v + w x t, so that v = dt + t x w.
  Matrix6d twist_by_place = Matrix6d::Identity();
  twist_by_place.topRightCorner<3, 3>() = skew(pose.T_camera_object.translation());
  const Matrix6d covariance = twist_by_place * placeCovariance(pose, usual) * twist_by_place.transpose();
  seen.upper.topLeftCorner<6, 6>() = Matrix6d(covariance.inverse()).llt().matrixU();
  return seen;
}

}  // namespace angio

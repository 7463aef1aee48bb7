// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/pose_covariance.hpp"

namespace angio::registration {
namespace {

Matrix6d symmetric(const Matrix6d& C) { return 0.5 * (C + C.transpose()); }

}  // namespace

// R_true = R exp(w) gives dw = R w in camera axes; t_true = T (c + exp(xi)(-c)) gives dt = R (v + c x w).
Matrix6d covarianceOfResult(const Matrix6d& about_centroid, const Pose& T_camera_model,
                            const Eigen::Vector3d& centroid_model) {
  const Eigen::Matrix3d R = T_camera_model.linear();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = R;
  J.topRightCorner<3, 3>() = R * skew(centroid_model);
  return symmetric(J * about_centroid * J.transpose());
}

// w = R^T dw, v = R^T dt - c x w.
Matrix6d covarianceAboutCentroid(const Matrix6d& of_result, const Pose& T_camera_model,
                                 const Eigen::Vector3d& centroid_model) {
  const Eigen::Matrix3d Rt = T_camera_model.linear().transpose();
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = J.bottomRightCorner<3, 3>() = Rt;
  J.topRightCorner<3, 3>() = -skew(centroid_model) * Rt;
  return symmetric(J * of_result * J.transpose());
}

}  // namespace angio::registration

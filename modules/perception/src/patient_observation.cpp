// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/patient_observation.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"

namespace angio::perception {

Eigen::Matrix<double, 2, 3> acrossRay(const Eigen::Vector3d& p_camera) {
  Eigen::Matrix<double, 2, 3> across;
  across << 1, 0, -p_camera.x() / p_camera.z(), 0, 1, -p_camera.y() / p_camera.z();
  return across;
}

double worstStd_m(const Eigen::Matrix3d& covariance_m2) {
  return std::sqrt(std::max(0.0, eigenOfSymmetric(covariance_m2).values[2]));
}

Matrix6d covarianceAbout(const Eigen::Vector3d& Rp, const Eigen::Matrix3d& point_m2,
                         const Eigen::Matrix3d& rotation_rad2) {
  const Eigen::Matrix3d lever = skew(Rp);
  Matrix6d covariance;
  covariance << point_m2 + lever * rotation_rad2 * lever.transpose(), lever * rotation_rad2,
      rotation_rad2 * lever.transpose(), rotation_rad2;
  return covariance;
}

Eigen::Matrix3d PatientObservation::pointCovariance(const Eigen::Vector3d& p_model,
                                                    const Eigen::Matrix3d& R_axes_camera) const {
  if (points) return R_axes_camera * points->covarianceAt(p_model) * R_axes_camera.transpose();
  Eigen::Matrix<double, 3, 6> J;
  J << R_axes_camera, -R_axes_camera * skew(T_camera_model.linear() * p_model);
  return J * covariance * J.transpose();
}

std::optional<RegistrationPoints> registrationPoints(const RegistrationResult& seen, const VesselTree& tree,
                                                     ModelId model_id, std::int64_t frame_time_us,
                                                     std::int64_t frame_sequence) {
  if (!seen.covariance || !seen.covariance->allFinite()) return std::nullopt;
  RegistrationPoints said{frame_time_us, frame_sequence, model_id, {}};
  const PatientObservation patient = PatientObservation::of(seen);
  said.covariance.resize(6, tree.size());
  for (Eigen::Index i = 0; i < tree.size(); ++i) {
    const Eigen::Matrix3d C = patient.pointCovariance(tree.points().col(i));
    Eigen::Matrix<double, 6, 1> six;
    six << C(0, 0), C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2);
    said.covariance.col(i) = six.cast<float>();
  }
  if (!said.covariance.allFinite()) return std::nullopt;
  for (const int variance : {0, 3, 5}) said.covariance.row(variance) = said.covariance.row(variance).cwiseMax(0.0F);
  return said;
}

double PatientObservation::depthStd_m(const Eigen::Vector3d& p_model) const {
  return std::sqrt(std::max(0.0, pointCovariance(p_model)(2, 2)));
}

double PatientObservation::worstStd_m(const Eigen::Vector3d& p_model) const {
  return angio::perception::worstStd_m(pointCovariance(p_model));
}

double PatientObservation::worstStdAcross_m(const Eigen::Vector3d& p_model) const {
  const Eigen::Matrix<double, 2, 3> across = acrossRay(placeAt(p_model));
  const Eigen::Matrix2d C = across * pointCovariance(p_model) * across.transpose();
  // The larger eigenvalue.
  return std::sqrt(std::max(0.0, 0.5 * C.trace() + std::hypot(0.5 * (C(0, 0) - C(1, 1)), C(0, 1))));
}

}  // namespace angio::perception

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/resolved_tree.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace angio::perception {
namespace {

// A deformation is the same within this.
constexpr double kAround_m = 5e-3;
// Along the axis of the turn the patient may be anywhere.
constexpr double kAlong_m = 50e-3;
// Of the way along the axis, across it, standard deviation: what organs are taken to do.
constexpr double kAcross = 1.0 / 3;
// Drift of a patient who lies still, standard deviations: over a minute, at once, and of the rotation.
constexpr double kDrift_m_per_root_minute = 1e-3, kAtOnce_m = 0.3e-3;
const double kTurns_rad = degToRad(0.1);
constexpr double kOutdated_s = 180;
constexpr Eigen::Index kLookedAt = 64;  // Of the tree's points.
// The second time with the way along the axis known.
constexpr int kRounds = 2;

// Where a registration has a point, with what the tree is deformed by around it.
Eigen::Vector3d placeIn(const RegistrationResult& seen, const Eigen::Vector3d& p_model,
                        const Eigen::VectorXd& weights) {
  if (seen.displacements_m.cols() != weights.size()) return seen.T_camera_model * p_model;
  return seen.T_camera_model * (p_model + seen.displacements_m * weights);
}

}  // namespace

ResolvedTree::ResolvedTree(const VesselTree& tree, const DepthFromMotion& fit, const Pose& T_camera_patient,
                           std::int64_t time_us)
    : tree_(tree),
      fit_(fit.registration),
      T_patient_camera_(T_camera_patient.inverse()),
      axis_(fit.axis),
      time_us_(time_us),
      R_camera_model_(fit_.T_camera_model.linear()),
      rotation_rad2_(fit_.covariance->bottomRightCorner<3, 3>()) {
  if (fit_.displacements_m.cols() != tree.size()) return;
  // How a deformed tree is turned is how the rigid one is that is nearest to it: of a fit, pose and deformation share
  // it.
  const Eigen::Matrix3Xd deformed = fit_.T_camera_model * (tree.points() + fit_.displacements_m);
  const Pose nearest(Eigen::umeyama(tree.points(), deformed, false));
  R_camera_model_ = nearest.linear();
  // No point is further off than by its own uncertainty: as if all of that were a rotation.
  const Eigen::Matrix3Xd centered = deformed.colwise() - deformed.rowwise().mean();
  const double across_m2 = centered.topRows<2>().squaredNorm() / (2.0 * static_cast<double>(tree.size()));
  const Eigen::Index stride = std::max<Eigen::Index>(1, tree.size() / kLookedAt);
  double sum_m2 = 0;
  int count = 0;
  for (Eigen::Index i = stride / 2; i < tree.size(); i += stride, ++count) {
    sum_m2 += PatientObservation::of(fit_).pointCovariance(tree.points().col(i))(2, 2);
  }
  if (count > 0 && across_m2 > 0) rotation_rad2_ = sum_m2 / (count * across_m2) * Eigen::Matrix3d::Identity();
}

double ResolvedTree::age_s(std::int64_t time_us) const {
  return 1e-6 * std::abs(static_cast<double>(time_us) - static_cast<double>(time_us_));
}

bool ResolvedTree::outdated(std::int64_t time_us) const { return age_s(time_us) > kOutdated_s; }

// A target lies beside the vessels: the further, the more of them have a part in it.
Eigen::VectorXd ResolvedTree::weights(const Eigen::Vector3d& p_model) const {
  const Eigen::ArrayXd squared_m2 = (tree_.points().colwise() - p_model).colwise().squaredNorm().transpose();
  const double nearest_m2 = squared_m2.minCoeff(), width_m = kAround_m + std::sqrt(nearest_m2);
  const Eigen::VectorXd weights = ((nearest_m2 - squared_m2) / (2 * width_m * width_m)).exp();
  return weights / weights.sum();
}

ResolvedTree::Place ResolvedTree::at(const Eigen::Vector3d& p_model, const RegistrationResult& seen,
                                     const Pose& T_camera_patient, std::int64_t time_us) const {
  const Eigen::VectorXd around = weights(p_model);
  const Pose T_camera_then = T_camera_patient * T_patient_camera_;
  const Eigen::Matrix3d R = T_camera_then.linear();
  const Eigen::Vector3d expected = T_camera_then * placeIn(fit_, p_model, around);
  const Eigen::Matrix3d known = R * PatientObservation::of(fit_).pointCovariance(p_model) * R.transpose();
  const Eigen::Vector3d axis = T_camera_patient.linear() * axis_;
  const Eigen::Matrix3d along = axis * axis.transpose();

  const Eigen::Vector3d shown = placeIn(seen, p_model, around);
  const Eigen::Matrix<double, 2, 3> H = acrossRay(shown);
  const Eigen::Vector2d off = H * (shown - expected);
  const Eigen::Matrix2d noise = H * PatientObservation::of(seen).pointCovariance(p_model) * H.transpose();
  const double drift2_m2 =
      kAtOnce_m * kAtOnce_m + kDrift_m_per_root_minute * kDrift_m_per_root_minute * age_s(time_us) / 60;

  Place place{expected, known};
  double along_axis_m = 0;
  for (int round = 0; round < kRounds; ++round) {
    const double across2_m2 = kAcross * kAcross * along_axis_m * along_axis_m + drift2_m2;
    const Eigen::Matrix3d prior =
        known + kAlong_m * kAlong_m * along + across2_m2 * (Eigen::Matrix3d::Identity() - along);
    const Eigen::Matrix2d information = (H * prior * H.transpose() + noise).inverse();
    const Eigen::Matrix<double, 2, 3> gain = information * H * prior;
    place.camera = expected + gain.transpose() * off;
    place.covariance_m2 = prior - gain.transpose() * H * prior;
    place.mismatch = off.dot(information * off);
    along_axis_m = axis.dot(place.camera - expected);
  }
  return place;
}

PatientObservation ResolvedTree::pose(const Eigen::Vector3d& p_model, const Place& place,
                                      const RegistrationResult& seen, const Pose& T_camera_patient) const {
  const Pose T_camera_then = T_camera_patient * T_patient_camera_;
  const Eigen::Vector3d ray = place.camera.normalized();
  const Eigen::Matrix3d beam = ray * ray.transpose(), across = Eigen::Matrix3d::Identity() - beam;

  PatientObservation patient;
  const Eigen::Matrix3d told = T_camera_then.linear() * R_camera_model_;
  const Eigen::Vector3d turned = logSO3(seen.T_camera_model.linear() * told.transpose());
  patient.T_camera_model.linear() = expSO3(beam * turned) * told;
  patient.T_camera_model.translation() = place.camera - patient.T_camera_model.linear() * p_model;

  const Eigen::Matrix3d R = T_camera_then.linear();
  const Eigen::Matrix3d known =
      R * rotation_rad2_ * R.transpose() + kTurns_rad * kTurns_rad * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d rotation = across * known * across + beam * seen.covariance->bottomRightCorner<3, 3>() * beam;
  patient.covariance = covarianceAbout(patient.T_camera_model.linear() * p_model, place.covariance_m2, rotation);
  return patient;
}

}  // namespace angio::perception

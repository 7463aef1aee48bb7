// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_claims.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "angio/geometry/matern.hpp"
#include "angio/perception/catheter_registration.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::perception {
namespace {

// A catheter lies anywhere in its vessel: half a radius off the axis, as a standard deviation. At least 1 mm, as a
// point of the vessel may also have gone along it, which a curve does not show.
double besideAxis_m(const VesselTree& vessels) {
  constexpr double kLeast_m = 1e-3;
  double sum_m = 0;
  int known = 0;
  for (const auto& radius_m : vessels.radii()) {
    if (radius_m) sum_m += *radius_m, ++known;
  }
  return known > 0 ? std::max(kLeast_m, 0.5 * sum_m / known) : kLeast_m;
}

// Errors of four brains deformed by 5 mm (20 runs, 115 frames) are 1.0 mm across the beam at scores above 0.8, and 1.3,
// 1.4 and 1.8 mm in each tenth below.
double asExplained(const AlignmentScore& alignment) {
  constexpr double kWell = 0.85, kByScore = 4;
  return 1 + kByScore * std::max(0.0, kWell - alignment.score());
}

// What a tree may be bent by where no curve shows it, per axis: as much as trees are that registration is tried on.
constexpr double kBend_m = 5e-3;

// What goes together of a deformation at places so far apart.
double correlation(double distance_m) {
  constexpr double kLength_m = 30e-3;
  return maternCorrelation(std::sqrt(5.0) * distance_m / kLength_m);
}

// What a fit to a catheter's curve claims of a point, and what it cannot know.
class WithUnknowns final : public PointUncertainty {
 public:
  WithUnknowns(const RegistrationResult& fit, double beside_m, double depth_m, const VesselTree& vessels)
      : fit_(PatientObservation::of(fit)),
        beside_m_(beside_m),
        depth_m_(depth_m),
        vessels_(vessels.points()),
        tip_(vessels_.rightCols<1>()) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override {
    const Eigen::Vector3d ray = (fit_.T_camera_model * p_model).normalized();
    const double near = std::max(0.0, 1 - (p_model - tip_).norm() / kNearTip_m);
    const double beside_m = beside_m_ + near * std::max(0.0, kAtTip_m - beside_m_);
    const double shared = correlation(std::sqrt((vessels_.colwise() - p_model).colwise().squaredNorm().minCoeff()));
    const double own_m2 = kBend_m * kBend_m * (1 - shared * shared);
    return fit_.pointCovariance(p_model) + (beside_m * beside_m + own_m2) * Eigen::Matrix3d::Identity() +
           depth_m_ * depth_m_ * ray * ray.transpose();
  }

 private:
  // The newest vessels have been seen by few frames, and may be taken for their neighbours.
  static constexpr double kNearTip_m = 40e-3, kAtTip_m = 2.6e-3;
  PatientObservation fit_;
  double beside_m_, depth_m_;
  Eigen::Matrix3Xd vessels_;
  Eigen::Vector3d tip_;
};

}  // namespace

void addUnknowns(const VesselTree& vessels, RegistrationResult& fit) {
  if (!fit.covariance) return;
  const double beside_m = asExplained(fit.alignment) * besideAxis_m(vessels),
               depth_m = 1e-3 * SequenceSettings().pose_translation_std_mm;
  fit.points = std::make_shared<WithUnknowns>(fit, beside_m, depth_m, vessels);
  const Eigen::Vector3d unknown_m2(beside_m * beside_m, beside_m * beside_m, beside_m * beside_m + depth_m * depth_m);
  fit.covariance->diagonal().head<3>() += unknown_m2;
  if (!fit.spread) return;
  fit.spread->across_m = std::hypot(fit.spread->across_m, std::sqrt(unknown_m2.head<2>().sum()));
  fit.spread->all_m = std::hypot(fit.spread->all_m, std::sqrt(unknown_m2.sum()));
}

RegistrationResult ofWholeTree(const RegisteredByCatheter& by) {
  RegistrationResult result = by.result;
  if (result.covariance) result.covariance->diagonal().head<3>().array() += kBend_m * kBend_m;
  if (result.status == RegistrationStatus::kConverged) {
    result.reason = "by a catheter alone: of the vessels that it lies in, and across the beam";
  }
  return result;
}

PatientObservation observationAt(const Eigen::Vector3d& p_model, const RegisteredByCatheter& by,
                                 const VesselTree& tree) {
  const RegistrationResult& seen = by.result;
  PatientObservation patient = PatientObservation::of(seen);
  const Eigen::Matrix3d known = patient.pointCovariance(p_model);
  const Eigen::Vector3d lever = patient.T_camera_model.linear() * p_model;
  if (seen.displacements_m.cols() == tree.size()) {
    patient.T_camera_model =
        patient.T_camera_model * Eigen::Translation3d(seen.displacements_m.col(nearestPoint(tree, p_model)));
  }
  const Eigen::Matrix3d rotation = patient.covariance.bottomRightCorner<3, 3>();
  patient.covariance = covarianceAbout(lever, known, rotation);
  return patient;
}

}  // namespace angio::perception

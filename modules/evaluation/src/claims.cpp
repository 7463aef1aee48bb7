// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>

#include "angio/evaluation/case_run.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/perception/registration_gate.hpp"

namespace angio::evaluation {

// A task may be asked for any place of the tree: so many of them must be known well enough.
constexpr double kMostPlaces = 0.95;
// Each asks for a covariance, and that of a deformed fit solves a system of up to 400 unknowns.
constexpr Eigen::Index kPlaces = 60;

void addClaims(const VesselTree& tree, bool of_each_point, CaseOutcome& outcome) {
  const RegistrationResult& result = outcome.result;
  outcome.usable_for.clear();
  outcome.point_covariances_m2.clear();
  if (!result.covariance || !result.covariance->allFinite()) return;
  const PatientObservation seen{result.T_camera_model, *result.covariance, result.points};
  const Eigen::Matrix3Xd& points = tree.points();
  if (of_each_point) {
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      outcome.point_covariances_m2.push_back(seen.pointCovariance(points.col(i)));
    }
  }
  if (result.status != RegistrationStatus::kConverged) return;
  const double enough_m = 1e-3 * RegistrationGateSettings().max_target_std_mm;
  double places = 0, across = 0, everywhere = 0;
  const Eigen::Index stride = std::max<Eigen::Index>(1, points.cols() / kPlaces);
  for (Eigen::Index i = stride / 2; i < points.cols(); i += stride, ++places) {
    across += seen.worstStdAcross_m(points.col(i)) <= enough_m;
    everywhere += seen.worstStd_m(points.col(i)) <= enough_m;
  }
  if (across >= kMostPlaces * places) outcome.usable_for.push_back("centre");
  if (everywhere >= kMostPlaces * places) {
    outcome.usable_for.push_back("view");
    outcome.usable_for.push_back("navigate");
  }
}

}  // namespace angio::evaluation

// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation_claims.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "angio/geometry/decompositions.hpp"
#include "angio/perception/patient_observation.hpp"

namespace angio::evaluation {
namespace {

// Of a 3D normal error, the square of the distance that 99.73 % stay within.
constexpr double kBeyond2 = 14.16;
constexpr Eigen::Index kClaimPoints = 300;

// More of the tree's points beyond the claim than this, and the claim is wrong.
constexpr double kMaxBeyond = 0.05;

}  // namespace

std::optional<CaseOutcome::Claim> claimOf(const VesselTree& tree, const RegistrationResult& result,
                                          const SimulatedTrial& trial) {
  if (!result.covariance) return std::nullopt;
  const PatientObservation seen{result.T_camera_model, *result.covariance, result.points};
  CaseOutcome::Claim claim;
  double count = 0;
  const Eigen::Index stride = std::max<Eigen::Index>(1, tree.points().cols() / kClaimPoints);
  for (Eigen::Index i = stride / 2; i < tree.points().cols(); i += stride, ++count) {
    Eigen::Vector3d model = tree.points().col(i), truth = model;
    if (result.displacements_m.cols() > i) model += result.displacements_m.col(i);
    if (trial.displacements_m.cols() > i) truth += trial.displacements_m.col(i);
    const Eigen::Matrix3d C = seen.pointCovariance(tree.points().col(i));
    const Eigen::Vector3d error = result.T_camera_model * model - trial.truth * truth;
    const Eigen::Vector3d ray = (result.T_camera_model * model).normalized();
    const Eigen::Quaterniond to_ray = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray);
    const Eigen::Matrix3d central = seen.centralCovariance(tree.points().col(i));
    const auto within = [&](const Eigen::Vector3d& axis) {
      return std::abs(axis.dot(error)) <= kInterval90 * std::sqrt(axis.dot(central * axis));
    };
    claim.beyond += squaredMahalanobis(error, C) > kBeyond2;
    claim.depth_in += within(ray);
    claim.plane_in += 0.5 * (within(to_ray * Eigen::Vector3d::UnitX()) + within(to_ray * Eigen::Vector3d::UnitY()));
  }
  for (double* share : {&claim.beyond, &claim.depth_in, &claim.plane_in}) *share /= count;
  return claim;
}

bool isConverged(const CaseOutcome& outcome) { return outcome.result.status == RegistrationStatus::kConverged; }

bool isConvergedAndWrong(const CaseOutcome& outcome) {
  return isConverged(outcome) && (!outcome.claim || outcome.claim->beyond > kMaxBeyond);
}

Json claimsByQuarter(const std::vector<CaseOutcome>& outcomes) {
  constexpr std::size_t kQuarters = 4, kMinCount = 4 * kQuarters;
  std::vector<const CaseOutcome*> claimed;
  for (const CaseOutcome& o : outcomes) {
    if (o.claim) claimed.push_back(&o);
  }
  if (claimed.size() < kMinCount) return nullptr;
  std::stable_sort(claimed.begin(), claimed.end(), [](const CaseOutcome* a, const CaseOutcome* b) {
    return a->result.alignment.score() > b->result.alignment.score();
  });
  Json quarters = Json::array();
  for (std::size_t q = 0; q < kQuarters; ++q) {
    const std::size_t from = q * claimed.size() / kQuarters, to = (q + 1) * claimed.size() / kQuarters;
    double depth_in = 0, plane_in = 0;
    int wrong = 0;
    for (std::size_t i = from; i < to; ++i) {
      depth_in += claimed[i]->claim->depth_in;
      plane_in += claimed[i]->claim->plane_in;
      wrong += isConvergedAndWrong(*claimed[i]);
    }
    const double percent = 100 / static_cast<double>(to - from);
    quarters.push_back({{"trials", to - from},
                        {"lowest_score", claimed[to - 1]->result.alignment.score()},
                        {"depth_in_90_percent", percent * depth_in},
                        {"plane_in_90_percent", percent * plane_in},
                        {"converged_and_wrong_percent", percent * wrong}});
  }
  return quarters;
}

}  // namespace angio::evaluation

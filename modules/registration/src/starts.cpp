// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/starts.hpp"

#include <cmath>
#include <random>
#include <vector>

namespace angio {
namespace {

// Poses whose points lie further apart than this on average are different answers; nearer ones are one basin.
constexpr double kDifferentPose_m = 3e-3;
// A different pose with this share of the best score leaves the choice open.
constexpr double kAmbiguousShare = 0.9;

// Box-Muller on the engine's own numbers: std::normal_distribution differs between libraries.
Eigen::Vector3d normal3(std::mt19937_64& engine) {
  Eigen::Vector3d result;
  for (int k = 0; k < 3; ++k) {
    const double u = (static_cast<double>(engine() >> 11) + 1) * 0x1p-53,
                 v = static_cast<double>(engine() >> 11) * 0x1p-53;
    result[k] = std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
  }
  return result;
}

double meanDistance(const VesselTree& tree, const Pose& a, const Pose& b) {
  return ((a * tree.points()) - (b * tree.points())).colwise().norm().mean();
}

void addTimes(RegistrationTimes& sum, const RegistrationTimes& more) {
  sum.prepare_s += more.prepare_s;
  sum.rigid_s += more.rigid_s;
  sum.nonrigid_s += more.nonrigid_s;
  sum.total_s += more.total_s;
}

}  // namespace

Pose drawnPose(const Pose& T_camera_model, const Eigen::Vector3d& centre_model, double rotation_std_rad,
               double translation_std_m, int seed, int index) {
  std::seed_seq sequence{seed, index};
  std::mt19937_64 engine(sequence);
  const Eigen::Vector3d w = rotation_std_rad * normal3(engine);
  const Eigen::Vector3d shift = translation_std_m * normal3(engine);
  Pose turn = Pose::Identity();
  turn.linear() = expSO3(w);
  const Eigen::Translation3d to_centre(centre_model);
  return T_camera_model * to_centre * Eigen::Translation3d(shift) * turn * to_centre.inverse();
}

RegistrationResult alignFromStarts(Registration& registration, const Centerline2d& centerline, const XrayCamera& camera,
                                   const PosePrior& prior, const StartSettings& starts) {
  checkSettings("starts", starts);
  std::vector<RegistrationResult> results;
  std::size_t best = 0;
  RegistrationTimes times;
  for (int i = 0; i < starts.count; ++i) {
    const Pose start =
        i == 0 ? prior.T_camera_model
               : drawnPose(prior.T_camera_model, registration.tree().centroid(), degToRad(starts.rotation_std_deg),
                           starts.translation_std_mm * 1e-3, starts.seed, i);
    results.push_back(registration.align(centerline, camera, prior, start));
    addTimes(times, results.back().times);
    if (results.back().agreement.score() > results[best].agreement.score()) best = results.size() - 1;
  }
  RegistrationResult result = results[best];
  result.times = times;
  if (starts.count == 1) return result;

  double other = 0;
  for (const auto& r : results) {
    if (meanDistance(registration.tree(), r.T_camera_model, result.T_camera_model) > kDifferentPose_m) {
      other = std::max(other, r.agreement.score());
    }
  }
  const double score = result.agreement.score();
  result.ambiguity = score > 0 ? other / score : 1.0;
  if (result.status == RegistrationStatus::kConverged && *result.ambiguity > kAmbiguousShare) {
    result.status = RegistrationStatus::kAmbiguous;
    result.reason = "a different pose fits nearly as well";
  }
  return result;
}

}  // namespace angio

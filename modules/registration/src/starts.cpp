// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/starts.hpp"

#include <cmath>
#include <random>
#include <vector>

#include "angio/geometry/decompositions.hpp"
#include "fit_classification.hpp"

namespace angio::registration {
namespace {

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

std::mt19937_64 engineFor(int seed, int index) {
  std::seed_seq sequence{seed, index};
  return std::mt19937_64(sequence);
}

Pose offsetAbout(const Pose& T_camera_model, const Eigen::Vector3d& center_model, const Eigen::Vector3d& shift_m,
                 const Eigen::Vector3d& rotation_rad) {
  Pose turn = Pose::Identity();
  turn.linear() = expSO3(rotation_rad);
  const Eigen::Translation3d to_center(center_model);
  return T_camera_model * to_center * Eigen::Translation3d(shift_m) * turn * to_center.inverse();
}

}  // namespace

Pose drawnPose(const Pose& T_camera_model, const Eigen::Vector3d& center_model, double rotation_std_rad,
               double translation_std_m, int seed, int index) {
  std::mt19937_64 engine = engineFor(seed, index);
  const Eigen::Vector3d w = rotation_std_rad * normal3(engine);
  const Eigen::Vector3d shift = translation_std_m * normal3(engine);
  return offsetAbout(T_camera_model, center_model, shift, w);
}

Vector6d unitDraw(int seed, int index) {
  std::mt19937_64 engine = engineFor(seed, index);
  Vector6d z;
  z.tail<3>() = normal3(engine);
  z.head<3>() = normal3(engine);
  return z;
}

Pose drawnStart(const PosePrior& prior, const Eigen::Vector3d& center_model, const StartSettings& starts, int index) {
  std::mt19937_64 engine = engineFor(starts.seed, index);
  if (starts.box()) {
    const auto uniform3 = [&] {
      Eigen::Vector3d result;
      for (int k = 0; k < 3; ++k) result[k] = static_cast<double>(engine() >> 11) * 0x1p-52 - 1;
      return result;
    };
    const Eigen::Vector3d w = degToRad(starts.box_rotation_deg) * uniform3();
    const Eigen::Vector3d shift = 1e-3 * starts.box_translation_mm * uniform3();
    return offsetAbout(prior.T_camera_model, center_model, shift, w);
  }
  if (!prior.covariance) {
    return drawnPose(prior.T_camera_model, center_model, degToRad(starts.rotation_std_deg),
                     starts.translation_std_mm * 1e-3, starts.seed, index);
  }
  const Vector6d xi = lowerFactorOf(*prior.covariance).triangularView<Eigen::Lower>() * unitDraw(starts.seed, index);
  return offsetAbout(prior.T_camera_model, center_model, xi.head<3>(), xi.tail<3>());
}

RegistrationResult Registration::search(const XrayViews& views, const PosePrior& prior, const StartSettings& starts,
                                        const SearchProgress& progress) {
  checkSettings("starts", starts);
  const int count = std::max(1, starts.count);
  std::vector<RegistrationResult> results;
  std::size_t best = 0;
  RegistrationTimes times;
  for (int i = 0; i < count; ++i) {
    results.push_back(
        align(views, prior, i == 0 ? prior.T_camera_model : drawnStart(prior, tree().centroid(), starts, i)));
    times += results.back().times;
    if (results.back().alignment.score() > results[best].alignment.score()) best = results.size() - 1;
    if (progress) progress((i + 1.0) / count);
  }
  RegistrationResult result = results[best];
  result.times = times;
  if (count == 1) return result;

  double other = 0;
  for (const auto& r : results) {
    if (meanDistance(tree(), r.T_camera_model, result.T_camera_model) > kDifferentPose_m) {
      other = std::max(other, r.alignment.score());
    }
  }
  const double score = result.alignment.score();
  compareWithAlternative(score > 0 ? other / score : 1.0, result);
  return result;
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_simulation.hpp"

#include <utility>

#include "angio/geometry/decompositions.hpp"
#include "angio/registration/starts.hpp"
#include "hand_eye_problem.hpp"

namespace angio::calibration {
namespace {

constexpr double kModelOffset_m = 0.03;

CArmJoints jointsOf(const OrbitSettings& orbit, int pose) {
  CArmJoints joints = CArmJoints::Zero();
  const bool single = orbit.max_secondary_deg == 0;
  const int first = single ? orbit.poses : (orbit.poses + 1) / 2;
  const bool primary = pose < first;
  const int count = primary ? first : orbit.poses - first, at = primary ? pose : pose - first;
  // Middles of equal parts, so that the two arcs do not share the view in the middle when their counts are even.
  const double share = (2.0 * at + 1) / count - 1;
  joints[primary ? 0 : 1] = degToRad(share * (primary ? orbit.max_primary_deg : orbit.max_secondary_deg));
  return joints;
}

}  // namespace

SimulatedPoseSet simulatedOrbit(const CArmGeometry& carm, const OrbitSettings& orbit, int seed) {
  checkSettings("orbit", orbit);
  // Standard normal draws by their purpose, one seed each set.
  int draws = 0;
  const auto drawn = [&](double translation_m, double rotation_rad) {
    Vector6d draw = unitDraw(seed, draws++);
    draw.head<3>() *= translation_m;
    draw.tail<3>() *= rotation_rad;
    return draw;
  };
  SimulatedPoseSet simulated;
  HandEyeTransforms& truth = simulated.truth;
  truth.X = movedBy(Pose::Identity(), drawn(1e-3 * orbit.mount_mm, degToRad(orbit.mount_deg)));
  truth.Z = movedBy(Pose::Identity(), drawn(kModelOffset_m, 2));
  PoseSet& set = simulated.set;
  set.path = "simulated poses";
  set.machine = "simulated";
  set.camera_std = PoseSigma{degToRad(orbit.camera_noise_deg), 1e-3 * orbit.camera_noise_mm};
  set.hand_std = PoseSigma{degToRad(orbit.hand_noise_deg), 1e-3 * orbit.hand_noise_mm};
  for (int i = 0; i < orbit.poses; ++i) {
    HandEyePose pose;
    pose.name = std::to_string(i + 1);
    pose.joints = jointsOf(orbit, i);
    pose.T_base_hand = carm.T_camera_patient(*pose.joints).inverse();
    const Vector6d hand_noise = drawn(1e-3 * orbit.hand_noise_mm, degToRad(orbit.hand_noise_deg));
    const Vector6d camera_noise = drawn(1e-3 * orbit.camera_noise_mm, degToRad(orbit.camera_noise_deg));
    const Pose hand = movedBy(Pose::Identity(), hand_noise) * pose.T_base_hand;
    pose.T_camera_object = movedBy(HandEyeEquations::predicted(hand, truth.X, truth.Z), camera_noise);
    set.poses.push_back(std::move(pose));
  }
  return simulated;
}

Eigen::Matrix<double, 12, 1> errorOf(const HandEyeTransforms& found, const HandEyeTransforms& truth) {
  Eigen::Matrix<double, 12, 1> error;
  error << truth.X.translation() - found.X.translation(), logSO3(truth.X.linear() * found.X.linear().transpose()),
      truth.Z.translation() - found.Z.translation(), logSO3(truth.Z.linear() * found.Z.linear().transpose());
  return error;
}

std::vector<HandEyeTrial> handEyeTrials(const CArmGeometry& carm, const OrbitSettings& orbit,
                                        const HandEyeSettings& settings, int trials, int first_seed,
                                        const std::function<void(int done)>& tell) {
  std::vector<HandEyeTrial> all;
  for (int trial = 0; trial < trials; ++trial) {
    OrbitSettings drawn = orbit;
    if (settings.mount == HandEyeMount::kIdentity) drawn.mount_deg = drawn.mount_mm = 0;
    const SimulatedPoseSet simulated = simulatedOrbit(carm, drawn, first_seed + trial);
    const HandEyeResult result = calibrateHandEye(simulated.set, settings);
    const auto error = errorOf(result.transforms, simulated.truth);
    const Eigen::VectorXd free = error.tail(result.covariance.rows());
    all.push_back({error, squaredMahalanobis(free, result.covariance)});
    if (tell) tell(trial + 1);
  }
  return all;
}

}  // namespace angio::calibration

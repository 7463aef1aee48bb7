// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_solvers.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Exact poses of any kind: hands anywhere within half a metre, turned in any way.
HandEyeEquations exactEquations(unsigned seed, int poses, HandEyeTransforms& truth) {
  test::Random random(seed);
  truth.X = expSE3(random.twist(0.1, 1));
  truth.Z = expSE3(random.twist(0.5, 1));
  HandEyeEquations equations;
  for (int i = 0; i < poses; ++i) {
    const Pose hand = expSE3(random.twist(0.3, 0.7));
    equations.add(hand, HandEyeEquations::predicted(hand, truth.X, truth.Z));
  }
  return equations;
}

double apart(const Pose& a, const Pose& b) { return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff(); }

// Rounding of a least squares of a hundred motions.
constexpr double kExact = 1e-9;

TEST(HandEyeSolvers, AreExactWithoutNoise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    HandEyeTransforms truth;
    const HandEyeEquations equations = exactEquations(seed, 3 + static_cast<int>(seed % 10), truth);
    for (const auto& found : {solveParkMartin(equations), solveShah(equations)}) {
      EXPECT_LT(apart(found.X, truth.X), kExact) << seed;
      EXPECT_LT(apart(found.Z, truth.Z), kExact) << seed;
      const HandEyeResiduals residuals = handEyeResiduals(equations, found);
      EXPECT_LT(residuals.rotation_rad + residuals.translation_m, kExact) << seed;
    }
  }
}

TEST(HandEyeSolvers, TwoAxesAreEnough) {
  // As a C-arm turns: the motions' axes span a plane only, and the third direction comes from their handedness.
  const CArmGeometry carm;
  HandEyeTransforms truth;
  exactEquations(3, 3, truth);
  HandEyeEquations equations;
  for (const auto& [primary_deg, secondary_deg] :
       {std::pair(-30, 0), std::pair(20, 0), std::pair(45, 0), std::pair(0, 25), std::pair(0, -15)}) {
    CArmJoints joints = CArmJoints::Zero();
    joints.head<2>() << degToRad(primary_deg), degToRad(secondary_deg);
    const Pose hand = carm.T_camera_patient(joints).inverse();
    equations.add(hand, HandEyeEquations::predicted(hand, truth.X, truth.Z));
  }
  for (const auto& found : {solveParkMartin(equations), solveShah(equations)}) {
    EXPECT_LT(apart(found.X, truth.X), kExact);
    EXPECT_LT(apart(found.Z, truth.Z), kExact);
  }
}

TEST(HandEyeSolvers, BothSetupsAreOneEquation) {
  test::Random random(8);
  PoseSet set;
  set.setup = HandEyeSetup::kEyeToHand;
  const Pose T_base_camera = expSE3(random.twist(0.5, 1)), T_hand_object = expSE3(random.twist(0.1, 1));
  for (int i = 0; i < 5; ++i) {
    HandEyePose pose;
    pose.T_base_hand = expSE3(random.twist(0.3, 0.7));
    pose.T_camera_object = T_base_camera.inverse() * pose.T_base_hand * T_hand_object;
    set.poses.push_back(pose);
  }
  const HandEyeTransforms found = solveShah(handEyeEquations(set));
  EXPECT_LT(apart(found.X, T_base_camera), kExact);
  EXPECT_LT(apart(found.Z, T_hand_object), kExact);
}

TEST(ComparedSolvers, SpeakOfTheSameTransforms) {
  // A frame mixed up on the way to another library would show here: most of them are exact on exact poses.
  HandEyeTransforms truth;
  const HandEyeEquations equations = exactEquations(5, 10, truth);
  testing::internal::CaptureStdout();
  const std::vector<ComparedSolver> all = compareSolvers(equations);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  int right = 0;
  for (const ComparedSolver& solver : all) {
    // ViSP stops iterating at its own tolerance.
    right +=
        solver.transforms && apart(solver.transforms->X, truth.X) < 1e-5 && apart(solver.transforms->Z, truth.Z) < 1e-5;
  }
  EXPECT_GE(right, 6);
}

}  // namespace
}  // namespace angio::test

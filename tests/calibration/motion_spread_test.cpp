// SPDX-License-Identifier: GPL-2.0-or-later
// What a hand-eye calibration must refuse, and how it says so.
#include "angio/calibration/hand_eye_solvers.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "angio/calibration/hand_eye_simulation.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr HandEyeSetup kSetups[] = {HandEyeSetup::kEyeInHand, HandEyeSetup::kEyeToHand};

// Fifteen poses of a robot with noise of 0.1 deg and 0.3 mm; `move` gives the hands, `spoil` what the file then says.
PoseSet robotPoses(HandEyeSetup setup, const std::function<Pose(test::Random&, int)>& move, int poses = 15) {
  test::Random random(11);
  const HandEyeTransforms truth = {expSE3(random.twist(0.05, 0.5)), expSE3(random.twist(0.5, 0.8))};
  PoseSet set;
  set.path = "poses.yaml";
  set.setup = setup;
  for (int i = 0; i < poses; ++i) {
    HandEyePose pose;
    pose.name = "p" + std::to_string(i);
    const Pose hand = move(random, i);
    pose.T_base_hand = setup == HandEyeSetup::kEyeInHand ? hand : Pose(hand.inverse());
    pose.T_camera_object = HandEyeEquations::predicted(hand, truth.X, truth.Z);
    pose.T_camera_object.linear() = expSO3(random.vector(degToRad(0.1))) * pose.T_camera_object.linear();
    pose.T_camera_object.translation() += random.vector(0.3e-3);
    set.poses.push_back(pose);
  }
  return set;
}

Pose anywhere(test::Random& random, int) { return expSE3(random.twist(0.3, 0.4)); }

std::string refusalOfSet(const PoseSet& set) {
  return test::refusalOf([&] { calibrateHandEye(set); });
}

class BothSetups : public testing::TestWithParam<HandEyeSetup> {
 protected:
  void expectRefusal(const PoseSet& set, const std::string& words) {
    const std::string said = refusalOfSet(set);
    EXPECT_EQ(said.rfind("poses.yaml: ", 0), 0u) << said;
    EXPECT_NE(said.find(words), std::string::npos) << said;
  }
  PoseSet spoilt(const std::function<void(HandEyePose&)>& spoil) {
    PoseSet set = robotPoses(GetParam(), anywhere);
    for (HandEyePose& pose : set.poses) spoil(pose);
    return set;
  }
};
INSTANTIATE_TEST_SUITE_P(Setups, BothSetups, testing::ValuesIn(kSetups),
                         [](const auto& setup) { return setupName(setup.param); });

TEST_P(BothSetups, SoundPosesPass) { EXPECT_NO_THROW(calibrateHandEye(robotPoses(GetParam(), anywhere))); }

TEST_P(BothSetups, OneAxisIsNamedWithItsDirection) {
  const Eigen::Vector3d axis = Eigen::Vector3d(0.36, 0.48, 0.8);
  PoseSet set = robotPoses(GetParam(), [&](test::Random& random, int i) {
    Pose hand = Pose::Identity();
    hand.linear() = expSO3(0.1 * i * axis);
    hand.translation() = random.vector(0.1);
    return hand;
  });
  expectRefusal(set, "all motions turn about one axis, [0.360, 0.480, 0.800] in the " +
                         std::string(GetParam() == HandEyeSetup::kEyeInHand ? "hand" : "base") + "'s axes");
}

TEST_P(BothSetups, TranslationsAloneAreRefused) {
  expectRefusal(
      robotPoses(GetParam(), [](test::Random& random, int) { return Pose(Eigen::Translation3d(random.vector(0.2))); }),
      "translations alone leave the place of the camera");
}

TEST_P(BothSetups, TwoPosesAreTooFew) { expectRefusal(robotPoses(GetParam(), anywhere, 2), "must be at least 3"); }

TEST_P(BothSetups, MetresAgainstMillimetresAreNamedWithTheirFactor) {
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_base_hand.translation() *= 1e3; }), "multiplied by 1");
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_base_hand.translation() *= 1e-3; }), "multiplied by 0.001");
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_camera_object.translation() *= 1e-3; }), "millimetres");
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_camera_object.translation() *= 1e3; }), "millimetres");
}

TEST_P(BothSetups, WhatIsTakenTheWrongWayRoundIsNamed) {
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_base_hand = pose.T_base_hand.inverse(); }),
                "T_base_hand or T_camera_object is taken as its inverse");
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_camera_object = pose.T_camera_object.inverse(); }),
                "T_base_hand or T_camera_object is taken as its inverse");
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_camera_object.linear().transposeInPlace(); }),
                "T_camera_object.rotation is transposed");
  expectRefusal(spoilt([](HandEyePose& pose) { pose.T_base_hand.linear().transposeInPlace(); }),
                "T_base_hand.rotation is transposed");
  const Eigen::DiagonalMatrix<double, 3> flip(-1, 1, 1);
  expectRefusal(spoilt([&](HandEyePose& pose) {
                  pose.T_camera_object.linear() = flip * pose.T_camera_object.linear() * flip;
                  pose.T_camera_object.translation() = flip * pose.T_camera_object.translation();
                }),
                "the camera's image is mirrored");
}

TEST_P(BothSetups, CopiesAndStaleImagesAreNamed) {
  PoseSet set = robotPoses(GetParam(), anywhere);
  const HandEyePose& first = set.poses[3];
  HandEyePose& second = set.poses[9];
  second.T_camera_object = first.T_camera_object;
  expectRefusal(set, "poses = p9: has the very T_camera_object of p3");
  second.T_base_hand = first.T_base_hand;
  expectRefusal(set, "poses = p9: is a copy of p3");
}

TEST_P(BothSetups, HalfOfAnotherMachineIsNamedPoseByPose) {
  PoseSet set = robotPoses(GetParam(), anywhere, 16);
  const Pose other = expSE3((Twist() << 0.03, -0.02, 0.05, 0.1, 0.2, -0.1).finished());
  for (std::size_t i = 0; i < set.poses.size(); i += 2)
    set.poses[i].T_camera_object = other * set.poses[i].T_camera_object;
  const std::string said = refusalOfSet(set);
  EXPECT_NE(said.find("two machines"), std::string::npos) << said;
  const bool odd_first = said.find("p1, p3, p5, p7, p9, p11, p13, p15") != std::string::npos;
  const bool even_first = said.find("p0, p2, p4, p6, p8, p10, p12, p14") != std::string::npos;
  EXPECT_TRUE(odd_first && even_first) << said;
}

TEST_P(BothSetups, ShuffledImagesFitNothing) {
  PoseSet set = robotPoses(GetParam(), anywhere);
  const Pose first = set.poses[0].T_camera_object;
  for (std::size_t i = 0; i + 1 < set.poses.size(); ++i)
    set.poses[i].T_camera_object = set.poses[i + 1].T_camera_object;
  set.poses.back().T_camera_object = first;
  expectRefusal(set, "hands and images of the same moments?");
}

TEST(TranslationScale, FindsTheFactorOrSaysNothing) {
  PoseSet set = robotPoses(HandEyeSetup::kEyeInHand, anywhere);
  for (HandEyePose& pose : set.poses) pose.T_camera_object.translation() /= 1.2;
  const auto scale = translationScale(handEyeEquations(set));
  ASSERT_TRUE(scale);
  EXPECT_NEAR(scale->value, 1.2, 4 * scale->sigma);
  EXPECT_LT(scale->sigma, 0.02);
  // A C-arm about its isocentre: the camera could sit at any distance.
  EXPECT_FALSE(translationScale(handEyeEquations(simulatedOrbit(CArmGeometry(), OrbitSettings(), 1).set)));
}

}  // namespace
}  // namespace angio::test

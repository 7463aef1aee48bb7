// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_law.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/geometry/visp.hpp"
#include "angio/servo/desired_view.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "angio/test/types_of.hpp"

namespace angio::test {
namespace {

const CArmGeometry kArm;

CArmJoints jointsAt(double primary_deg, double secondary_deg,
                    const Eigen::Vector3d& table_m = Eigen::Vector3d::Zero()) {
  CArmJoints q;
  q << degToRad(primary_deg), degToRad(secondary_deg), table_m;
  return q;
}

const VesselTree& tree() {
  static const VesselTree kTree = test::branchingTree(6);
  return kTree;
}

LawInput inputOf(const Pose& seen, const Pose& desired, const CArmJoints& joints, const XrayCamera* camera) {
  const Pose T_patient_model = kArm.T_camera_patient(joints).inverse() * seen;
  const Eigen::Vector3d on_beam = desired.inverse() * Eigen::Vector3d(0, 0, kArm.source_isocenter_distance_m);
  const Eigen::Vector3d beam = T_patient_model.linear() * desired.linear().row(2).transpose();
  LawInput input{toVisp(seen), toVisp(desired), toVisp(kArm.eJe(joints)), camera};
  input.joints_left = kArm.jointsFor(viewAnglesOf(beam), T_patient_model * on_beam) - joints;
  return input;
}

// What every law must do, whatever its method.
template <typename Settings>
struct ServoLawConformance : testing::Test {
  const Settings settings{};
  const XrayCamera camera = kArm.camera();
  const Eigen::Vector3d target = tree().centroid();
  std::unique_ptr<ServoLaw> law = makeServoLaw(settings, {&tree(), target});

  std::optional<CArmJoints> velocity(const Pose& seen, const Pose& desired, const CArmJoints& joints) {
    return law->velocity(inputOf(seen, desired, joints, &camera));
  }

  // From joints q until a time, stepped so finely that nothing but the law is tested. T_patient_model: how the patient
  // lies. The error's largest rise from one tenth of a second to the next comes back.
  double driven(CArmJoints& q, const Pose& T_patient_model, const Pose& desired, double duration_s) {
    const double dt_s = 1e-2;
    double rise = 0, last = std::numeric_limits<double>::infinity();
    for (int step = 0; step < duration_s / dt_s; ++step) {
      const Pose seen = kArm.T_camera_patient(q) * T_patient_model;
      if (step % 10 == 0) {
        const ViewError error = viewError(seen, desired, target);
        const double size = error.direction_rad + error.target_m / kArm.source_isocenter_distance_m;
        rise = std::max(rise, size - last);
        last = size;
      }
      const auto v = velocity(seen, desired, q);
      if (!v) return std::numeric_limits<double>::infinity();
      q += *v * dt_s;
    }
    return rise;
  }
};
TYPED_TEST_SUITE(ServoLawConformance, typename test::TypesOf<ServoLawSettings>::type);

// A patient who lies askew.
Pose askew() {
  Twist twist;
  twist << 0.02, -0.01, 0.015, 0.05, -0.08, 0.1;
  return expSE3(twist);
}

TYPED_TEST(ServoLawConformance, RestsAtTheGoal) {
  test::Random random(1);
  for (int i = 0; i < 20; ++i) {
    const CArmJoints q = jointsAt(random.uniform(-100, 100), random.uniform(-50, 50), random.vector(0.1));
    const Pose seen = kArm.T_camera_patient(q) * expSE3(random.twist(0.02, 0.1));
    const auto v = this->velocity(seen, seen, q);
    ASSERT_TRUE(v);
    EXPECT_LT(v->norm(), 1e-9);  // Rounding of poses of a metre's size, through a pseudo-inverse of condition 10.
  }
}

// Starts all over the range, the table far out, a goal with an image that no joint can turn upright: the beam and the
// target get there all the same.
TYPED_TEST(ServoLawConformance, ReachesTheViewFromEverywhereWhateverTheRoll) {
  for (const double roll_deg : {0.0, 25.0, -90.0}) {
    const Pose T_patient_model = askew();
    Pose desired = desiredPose({{degToRad(30), degToRad(15)}, this->target, Eigen::Matrix3d::Identity()},
                               kArm.source_isocenter_distance_m);
    desired = Pose(Eigen::AngleAxisd(degToRad(roll_deg), Eigen::Vector3d::UnitZ())) * desired;
    for (const double primary_deg : {-100.0, -30.0, 25.0, 110.0}) {
      for (const double secondary_deg : {-50.0, 0.0, 55.0}) {
        CArmJoints q = jointsAt(primary_deg, secondary_deg, {0.1, -0.05, 0.15});
        const double rise = this->driven(q, T_patient_model, desired, 8);
        const ViewError end = viewError(kArm.T_camera_patient(q) * T_patient_model, desired, this->target);
        EXPECT_LT(radToDeg(end.direction_rad), 0.1) << primary_deg << " " << secondary_deg << " " << roll_deg;
        EXPECT_LT(1e3 * end.target_m, 0.5) << primary_deg << " " << secondary_deg << " " << roll_deg;
        EXPECT_LT(radToDeg(rise), 0.1) << primary_deg << " " << secondary_deg << " " << roll_deg;
      }
    }
  }
}

TYPED_TEST(ServoLawConformance, GoesOnlyByWhatTheCameraSees) {
  test::Random random(2);
  const Pose T_other_model = expSE3(random.twist(0.1, 1));
  Eigen::Matrix3Xd moved = tree().points();
  for (auto p : moved.colwise()) p = T_other_model * Eigen::Vector3d(p);
  const VesselTree other(moved, tree().parents(), tree().radii());
  const auto same = makeServoLaw(this->settings, {&other, T_other_model * this->target});
  for (int i = 0; i < 20; ++i) {
    const CArmJoints q = jointsAt(random.uniform(-100, 100), random.uniform(-50, 50), random.vector(0.05));
    const Pose seen = kArm.T_camera_patient(q) * askew();
    const Pose desired = kArm.T_camera_patient(jointsAt(20, 10)) * askew();
    const auto v = this->velocity(seen, desired, q);
    const Pose T_model_other = T_other_model.inverse();
    const auto w = same->velocity(inputOf(seen * T_model_other, desired * T_model_other, q, &this->camera));
    ASSERT_TRUE(v && w);
    EXPECT_LT((*v - *w).norm(), 1e-9);
  }
}

TYPED_TEST(ServoLawConformance, TheGainGrowsTowardsTheGoalWhenAsked) {
  auto growing = this->settings;
  growing.lambda_at_goal_per_s = 3 * growing.lambda_per_s;
  growing.gain_change_deg = 2;
  auto constant = growing;
  constant.lambda_at_goal_per_s = constant.lambda_per_s;
  const auto eager = makeServoLaw(growing, {&tree(), this->target});
  const auto steady = makeServoLaw(constant, {&tree(), this->target});
  const Pose desired = kArm.T_camera_patient(jointsAt(20, 10));
  const auto ratioFrom = [&](double primary_deg) {
    const CArmJoints q = jointsAt(primary_deg, 10);
    const LawInput input = inputOf(kArm.T_camera_patient(q), desired, q, &this->camera);
    return eager->velocity(input)->norm() / steady->velocity(input)->norm();
  };
  EXPECT_NEAR(ratioFrom(20.01), 3, 0.02);
  EXPECT_NEAR(ratioFrom(60), 1, 0.02);
}

TYPED_TEST(ServoLawConformance, WhatIsNotANumberGivesNothing) {
  const CArmJoints q = jointsAt(10, 5);
  const Pose seen = kArm.T_camera_patient(q), desired = kArm.T_camera_patient(jointsAt(20, 0));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const auto& [row, column] : {std::pair(0, 0), std::pair(1, 2), std::pair(2, 3)}) {
      Pose broken = seen;
      broken.matrix()(row, column) = bad;
      EXPECT_FALSE(this->velocity(broken, desired, q));
      EXPECT_FALSE(this->velocity(seen, broken, q));
    }
    vpMatrix eJe = toVisp(kArm.eJe(q));
    eJe[3][1] = bad;
    LawInput input = inputOf(seen, desired, q, &this->camera);
    input.eJe = eJe;
    EXPECT_FALSE(this->law->velocity(input));
  }
  LawInput empty = inputOf(seen, desired, q, &this->camera);
  empty.eJe = vpMatrix();
  EXPECT_FALSE(this->law->velocity(empty));
  // And the next sound frame is answered as if nothing had been.
  const auto again = this->velocity(seen, desired, q);
  ASSERT_TRUE(again);
  EXPECT_EQ(*again,
            *makeServoLaw(this->settings, {&tree(), this->target})->velocity(inputOf(seen, desired, q, &this->camera)));
}

TYPED_TEST(ServoLawConformance, BehindTheSourceThereIsNothing) {
  const CArmJoints q = jointsAt(10, 5);
  const Pose sound = kArm.T_camera_patient(q);
  Pose behind = sound;
  behind.translation().z() = -0.8;
  EXPECT_FALSE(this->velocity(behind, sound, q));
  EXPECT_FALSE(this->velocity(sound, behind, q));
}

// Along the table both angles turn the arm about one axis: two errors, one joint.
TYPED_TEST(ServoLawConformance, ASingularArmGetsNothingOrANumber) {
  const Pose desired = kArm.T_camera_patient(jointsAt(20, 0));
  for (const double secondary_deg : {90.0, -90.0, 90 - 1e-9, 90 - 1e-6, 89.999}) {
    const CArmJoints q = jointsAt(10, secondary_deg);
    const auto v = this->velocity(kArm.T_camera_patient(q), desired, q);
    EXPECT_TRUE(!v || v->allFinite()) << secondary_deg;
  }
}

TYPED_TEST(ServoLawConformance, LeavesTheRollAlone) {
  const CArmJoints q = jointsAt(25, -12);
  const Pose seen = kArm.T_camera_patient(q);
  for (const double roll_rad : {0.3, -2.0, kPi}) {
    const Pose rolled = Pose(Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ())) * seen;
    const auto v = this->velocity(seen, rolled, q);
    ASSERT_TRUE(v);
    EXPECT_LT(v->norm(), 1e-9);
  }
}

// What two of the laws promise of the poses themselves.
template <typename Settings>
struct PoseLaws : ServoLawConformance<Settings> {};
using BothPoseLaws = testing::Types<PositionBasedSettings, HybridSettings>;
TYPED_TEST_SUITE(PoseLaws, BothPoseLaws);

TYPED_TEST(PoseLaws, TheErrorDecaysExponentially) {
  auto constant = this->settings;
  constant.lambda_at_goal_per_s = constant.lambda_per_s;
  this->law = makeServoLaw(constant, {&tree(), this->target});
  const double dt_s = 1e-3, lambda = constant.lambda_per_s;
  const Pose T_patient_model = askew();
  const Pose desired =
      kArm.T_camera_patient(kArm.jointsFor({degToRad(30), degToRad(15)}, T_patient_model * this->target)) *
      T_patient_model;
  CArmJoints q = jointsAt(5, -10, {0.02, -0.03, 0.04});
  const auto seen = [&] { return Pose(kArm.T_camera_patient(q) * T_patient_model); };
  const auto direction = [&] { return viewError(seen(), desired, this->target).direction_rad; };
  const double first = direction();
  for (int step = 1; step <= 2000; ++step) {
    const auto v = this->velocity(seen(), desired, q);
    ASSERT_TRUE(v);
    q += *v * dt_s;
    if (step % 250 != 0) continue;
    const double decay = std::exp(-lambda * step * dt_s);
    // Euler's steps lag by lambda^2 dt t / 2 = 0.3 % at the end.
    EXPECT_NEAR(direction() / first, decay, 0.005 * decay) << step;
  }
}

// qdot = lambda left, for each joint: the sign is that of its motion, and motions shrink in proportion, so that the
// table is on the line from start to goal all the time and the target comes nearer all the time.
TEST(JointSpace, GoesStraightInAllJointsAtOnce) {
  JointSpaceSettings settings;
  settings.lambda_at_goal_per_s = settings.lambda_per_s;
  const Eigen::Vector3d target = tree().centroid();
  const auto law = makeServoLaw(settings, {&tree(), target});
  const Pose T_patient_model = askew();
  const CArmJoints goal = kArm.jointsFor({degToRad(30), degToRad(15)}, T_patient_model * target);
  const Pose desired = kArm.T_camera_patient(goal) * T_patient_model;
  for (const double sign : {1.0, -1.0}) {
    const CArmJoints start = goal + sign * (CArmJoints() << degToRad(-70), degToRad(35), 0.12, -0.08, 0.2).finished();
    CArmJoints q = start;
    const double dt_s = 1e-3;
    double distance_m = std::numeric_limits<double>::infinity();
    for (int step = 0; step < 3000; ++step) {
      const Pose seen = kArm.T_camera_patient(q) * T_patient_model;
      const double now_m = viewError(seen, desired, target).target_m;
      ASSERT_LT(now_m, distance_m) << step;
      distance_m = now_m;
      const auto v = law->velocity(inputOf(seen, desired, q, nullptr));
      ASSERT_TRUE(v);
      for (int i = 0; i < kCArmJointCount; ++i) EXPECT_GT((*v)[i] * (goal[i] - start[i]), 0) << step << " " << i;
      q += *v * dt_s;
      const double left = std::pow(1 - settings.lambda_per_s * dt_s, step + 1);
      ASSERT_LT((q - goal - left * (start - goal)).norm(), 1e-9) << step;
    }
  }
}

TEST(JointSpace, NeedsTheRemainingMotion) {
  const Pose seen = kArm.T_camera_patient(jointsAt(10, 5)), desired = kArm.T_camera_patient(jointsAt(20, 0));
  const auto law = makeServoLaw(JointSpaceSettings{});
  LawInput input = inputOf(seen, desired, jointsAt(10, 5), nullptr);
  EXPECT_TRUE(law->velocity(input));
  input.joints_left->coeffRef(3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(law->velocity(input));
  input.joints_left.reset();
  EXPECT_FALSE(law->velocity(input));
}

TEST(ServoLaw, RefusesWhatItCannotWorkWith) {
  EXPECT_NE(test::refusalOf([] { makeServoLaw(PositionBasedSettings{0}); }).find("lambda_per_s = 0"),
            std::string::npos);
  EXPECT_EQ(test::refusalOf([] { makeServoLaw(ImageBasedSettings{}); }), "image_based: tree: the law needs one");
  EXPECT_EQ(test::refusalOf([] { makeServoLaw(HybridSettings{}); }), "hybrid: target: the law needs one");
}

}  // namespace
}  // namespace angio::test

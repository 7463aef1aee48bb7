// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_law.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/geometry/visp.hpp"
#include "angio/servo/desired_view.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"
#include "angio/test/types_of.hpp"

namespace angio {
namespace {

const CArmGeometry kArm;

CArmJoints jointsAt(double primary_deg, double secondary_deg,
                    const Eigen::Vector3d& table_m = Eigen::Vector3d::Zero()) {
  CArmJoints q;
  q << degToRad(primary_deg), degToRad(secondary_deg), table_m;
  return q;
}

// What every law must do, whatever its method.
template <typename Settings>
struct ServoLawConformance : testing::Test {
  const Settings settings{};
  std::unique_ptr<ServoLaw> law = makeServoLaw(settings);

  std::optional<CArmJoints> velocity(const Pose& seen, const Pose& desired, const CArmJoints& joints) {
    return law->velocity(toVisp(seen), toVisp(desired), toVisp(kArm.eJe(joints)));
  }
};
TYPED_TEST_SUITE(ServoLawConformance, typename test::TypesOf<ServoLawSettings>::type);

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

// The arm's own kinematics, stepped finely: what the law believes of them is tested with it.
TYPED_TEST(ServoLawConformance, TheErrorDecaysExponentially) {
  const double dt_s = 1e-3, lambda = this->settings.lambda_per_s;
  // A patient who lies askew; the view is one the arm can reach.
  Twist askew;
  askew << 0.02, -0.01, 0.015, 0.05, -0.08, 0.1;
  const Pose T_patient_model = expSE3(askew);
  const Eigen::Vector3d target(0.01, 0.02, -0.03);
  const Pose desired =
      kArm.T_camera_patient(kArm.jointsFor({degToRad(30), degToRad(15)}, T_patient_model * target)) * T_patient_model;
  CArmJoints q = jointsAt(5, -10, {0.02, -0.03, 0.04});
  const auto seen = [&] { return Pose(kArm.T_camera_patient(q) * T_patient_model); };
  const auto direction = [&] { return viewError(seen(), desired, target).direction_rad; };
  const auto shift = [&] { return (desired * seen().inverse()).translation().norm(); };
  const double first_direction = direction(), first_shift = shift();
  for (int step = 1; step <= 2000; ++step) {
    const auto v = this->velocity(seen(), desired, q);
    ASSERT_TRUE(v);
    q += *v * dt_s;
    if (step % 250 != 0) continue;
    const double decay = std::exp(-lambda * step * dt_s);
    // Euler's steps lag by lambda^2 dt t / 2 = 0.3 % at the end.
    EXPECT_NEAR(shift() / first_shift, decay, 0.005 * decay) << step;
    // The law's error is the rotation vector across the beam, this one the angle between beams: they differ by
    // angle^2 / 24 relative to each other for a rotation without roll, and by as much again for its roll: 2 % at 0.6
    // rad.
    EXPECT_NEAR(direction() / first_direction, decay, 0.025 * decay) << step;
  }
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
    EXPECT_FALSE(this->law->velocity(toVisp(seen), toVisp(desired), eJe));
  }
  // And the next sound frame is answered as if nothing had been.
  const auto again = this->velocity(seen, desired, q);
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, *makeServoLaw(this->settings)->velocity(toVisp(seen), toVisp(desired), toVisp(kArm.eJe(q))));
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

TEST(PositionBased, LeavesTheRollAlone) {
  const auto law = makeServoLaw(PositionBasedSettings{});
  const CArmJoints q = jointsAt(25, -12);
  const Pose seen = kArm.T_camera_patient(q);
  const Pose rolled = Pose(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())) * seen;
  const auto v = law->velocity(toVisp(seen), toVisp(rolled), toVisp(kArm.eJe(q)));
  ASSERT_TRUE(v);
  EXPECT_LT(v->norm(), 1e-9);
}

TEST(PositionBased, RefusesAGainOutOfRange) {
  EXPECT_NE(test::refusalOf([] { makeServoLaw(PositionBasedSettings{0}); }).find("lambda_per_s = 0"),
            std::string::npos);
}

}  // namespace
}  // namespace angio

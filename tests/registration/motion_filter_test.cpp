// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/motion_filter.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

const Eigen::Vector3d kCentroid(0.03, -0.12,
                                0.2);  // Far off the origin, as in a scanner's frame: lever arms must show.

Pose somePose(test::Random& random) {
  Pose T = expSE3(random.twist(0.1, 1));
  T.translation().z() += 0.75;
  return T;
}

// T Trans(c) exp(xi) Trans(-c), PosePrior's own words.
Pose about(const Pose& T, const Twist& xi) {
  const Eigen::Translation3d to_centroid(kCentroid);
  return T * to_centroid * expSE3(xi) * to_centroid.inverse();
}

Twist between(const Pose& from, const Pose& to) {
  const Eigen::Translation3d to_centroid(kCentroid);
  return logSE3(to_centroid.inverse() * from.inverse() * to * to_centroid);
}

// A covariance with millimetres and degrees in every direction, and correlations among them.
Matrix6d someCovariance(test::Random& random, double translation_m, double rotation_rad) {
  Matrix6d A;
  for (int k = 0; k < 6; ++k) A.col(k) = random.twist(translation_m, rotation_rad);
  return A * A.transpose() / 6;
}

Vector6d draw(test::Random& random, const Matrix6d& covariance) {
  return covariance.llt().matrixL() * random.twist(1, 1);
}

double normalized(const Twist& xi, const Matrix6d& covariance) { return xi.dot(covariance.ldlt().solve(xi)); }

TEST(PoseCovariance, GoesFromOneMeaningToTheOtherAndBack) {
  test::Random random(1);
  const Pose T = somePose(random);
  const Matrix6d about_centroid = someCovariance(random, 2e-4, 1e-3);
  const Matrix6d of_result = covarianceOfResult(about_centroid, T, kCentroid);
  // Draw by the one definition, read off by the other: (t, rotation in camera axes), R_true = exp(dw) R, t_true = t +
  // dt.
  const int draws = 4000;
  double sum = 0;
  Matrix6d scatter = Matrix6d::Zero();
  for (int i = 0; i < draws; ++i) {
    const Pose drawn = about(T, draw(random, about_centroid));
    Vector6d e;
    e << drawn.translation() - T.translation(), logSO3(drawn.linear() * T.linear().transpose());
    sum += normalized(e, of_result);
    scatter += e * e.transpose() / draws;
  }
  // Chi-square with six degrees of freedom: a standard deviation of sqrt(12), over sqrt(4000); four of them.
  EXPECT_NEAR(sum / draws, 6, 0.22);
  // The mean above holds the trace only. Whitened, the scatter is the identity up to sqrt(2/n) = 0.022 an entry; five.
  const Matrix6d L_inverse = Matrix6d(of_result.llt().matrixL()).inverse();
  EXPECT_LT((L_inverse * scatter * L_inverse.transpose() - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 0.11);

  const Matrix6d back = covarianceAboutCentroid(of_result, T, kCentroid);
  EXPECT_LT((back - about_centroid).norm(), 1e-12 * about_centroid.norm());
}

// Truth as the filter supposes it: constant velocity, white acceleration, in steps ten times finer than the frames.
struct SimulatedMotion {
  test::Random& random;
  MotionFilterSettings settings;
  Pose T;
  Twist velocity;

  SimulatedMotion(test::Random& generator, const MotionFilterSettings& s)
      : random(generator), settings(s), T(somePose(generator)) {
    velocity = generator.twist(1e-3 * s.first_speed_std_mm_per_s, degToRad(s.first_angular_speed_std_deg_per_s));
  }

  void advance(double dt) {
    const double h = dt / 10, per_step = std::sqrt(settings.acceleration_mean_s * h);
    for (int i = 0; i < 10; ++i) {
      const Twist push = per_step * random.twist(1e-3 * settings.acceleration_std_mm_per_s2,
                                                 degToRad(settings.angular_acceleration_std_deg_per_s2));
      T = about(T, (velocity + 0.5 * push) * h);
      velocity += push;
    }
  }
};

Matrix6d floorOf(const MotionFilterSettings& s) {
  Vector6d deviation;
  deviation << Eigen::Vector3d::Constant(1e-3 * s.measured_translation_std_mm),
      Eigen::Vector3d::Constant(degToRad(s.measured_rotation_std_deg));
  return deviation.cwiseAbs2().asDiagonal();
}

TEST(MotionFilter, PredictsAsSurelyAsItSays) {
  test::Random random(2);
  const MotionFilterSettings settings;
  const int trials = 500;
  double early = 0, late = 0, innovations = 0;
  for (int trial = 0; trial < trials; ++trial) {
    SimulatedMotion motion(random, settings);
    MotionFilter filter(settings, kCentroid);
    const Matrix6d said = someCovariance(random, 5e-4, 3e-3);
    for (int frame = 0; frame <= 20; ++frame) {
      const double time_s = frame / 15.0;
      if (frame > 0) motion.advance(1 / 15.0);
      if (frame == 2 || frame == 20) {
        const auto prior = filter.predict(time_s);
        ASSERT_TRUE(prior && prior->covariance);
        (frame == 2 ? early : late) += normalized(between(prior->T_camera_model, motion.T), *prior->covariance);
      }
      const auto innovation = filter.update(about(motion.T, draw(random, said + floorOf(settings))), said, time_s);
      EXPECT_EQ(innovation.has_value(), frame > 0);
      if (frame == 20) innovations += innovation->squared_mahalanobis;
    }
  }
  // 95 % of chi-square with 6 x 500 degrees of freedom, over 500: 6 -+ 1.96 sqrt(12 / 500).
  EXPECT_NEAR(early / trials, 6, 0.304);
  EXPECT_NEAR(late / trials, 6, 0.304);
  EXPECT_NEAR(innovations / trials, 6, 0.304);
}

TEST(MotionFilter, OneStepOverTwoFramesIsAsSureAsTwoSteps) {
  test::Random random(3);
  const Pose T = somePose(random);
  const Matrix6d precise = someCovariance(random, 5e-4, 3e-3);
  // A measurement that knows nothing is a step and no more.
  const Matrix6d nothing = 1e6 * Matrix6d::Identity();
  MotionFilter one({}, kCentroid), two({}, kCentroid);
  for (auto* filter : {&one, &two}) {
    filter->update(T, precise, 0);
    filter->update(about(T, (Twist() << 2e-3, 1e-3, -1e-3, 0.01, 0, 0.02).finished()), precise, 1 / 15.0);
  }
  two.update(two.predict(2 / 15.0)->T_camera_model, nothing, 2 / 15.0);
  const PosePrior a = *one.predict(3 / 15.0), b = *two.predict(3 / 15.0);
  EXPECT_LT(between(a.T_camera_model, b.T_camera_model).norm(), 1e-9);
  // The noise of a step is taken in the axes at its end, and a step turns them by 0.02 rad: its square is left. Noise
  // counted by the frame would be off by a third.
  EXPECT_LT((*a.covariance - *b.covariance).norm(), 4e-4 * a.covariance->norm());
}

// T_camera_model of a tree that breathes: one sine, along and about fixed axes.
struct Breath {
  Pose T0;
  Eigen::Vector3d along, axis;
  double amplitude_m, amplitude_rad, period_s = 4;

  Pose at(double time_s) const {
    const double s = std::sin(2 * kPi * time_s / period_s);
    Pose turn = Pose::Identity();
    turn.linear() = expSO3(amplitude_rad * s * axis);
    const Eigen::Translation3d to_centroid(kCentroid);
    return T0 * Eigen::Translation3d(amplitude_m * s * along) * to_centroid * turn * to_centroid.inverse();
  }
};

TEST(MotionFilter, KeepsUpWithABreath) {
  test::Random random(4);
  const MotionFilterSettings settings;
  const Matrix6d said = 0.25 * floorOf(settings);
  double sum = 0, largest = 0;
  int counted = 0, outside = 0;
  for (int patient = 0; patient < 20; ++patient) {
    const Pose T0 = somePose(random);
    const Eigen::Vector3d along = random.direction();
    const Breath breath{T0, along, random.direction(), 15e-3, degToRad(2)};
    MotionFilter filter(settings, kCentroid);
    for (int frame = 0; frame < 120; ++frame) {
      const double time_s = frame / 15.0;
      const Pose truth = breath.at(time_s);
      if (frame >= 3) {
        const PosePrior prior = *filter.predict(time_s);
        const Twist error = between(prior.T_camera_model, truth);
        sum += normalized(error, *prior.covariance);
        largest = std::max(largest, error.head<3>().norm());
        ++counted;
      }
      const auto innovation = filter.update(about(truth, draw(random, said + floorOf(settings))), said, time_s);
      if (innovation && !innovation->insideGate()) ++outside;
    }
  }
  // The largest step between frames is 1.6 mm. A lag of 0.55 mm, and 0.45 mm an axis of noise and motion: four of them.
  EXPECT_LT(largest, 2.5e-3);
  // A breath is no white noise, and the lag adds to the six of chi-square; a mean of twelve would be a covariance half
  // as large as it should be.
  EXPECT_GT(sum / counted, 4);
  EXPECT_LT(sum / counted, 9);
  EXPECT_LE(outside, counted / 200) << "a gate of 99.9 % must not lose the motion it was set up for";
}

TEST(MotionFilter, ReportsWhatLiesOutsideTheGateAndForgetsWhenAsked) {
  test::Random random(5);
  const Pose T = somePose(random);
  const Matrix6d said = 1e-8 * Matrix6d::Identity();
  MotionFilter filter({}, kCentroid);
  EXPECT_FALSE(filter.predict(0));
  EXPECT_FALSE(filter.innovation(T, said, 0));
  for (int frame = 0; frame < 15; ++frame) filter.update(T, said, frame / 15.0);
  const Pose near = about(T, (Twist() << 1e-3, 0, 0, 0, 0, 0).finished());
  const Pose far = about(T, (Twist() << 8e-3, 0, 0, 0, 0, 0).finished());
  EXPECT_TRUE(filter.innovation(near, said, 1)->insideGate());
  const auto innovation = filter.innovation(far, said, 1);
  EXPECT_FALSE(innovation->insideGate());
  EXPECT_NEAR(innovation->xi[0], 8e-3, 1e-4) << "in model axes, about the centroid";
  EXPECT_LT(between(T, filter.predict(1)->T_camera_model).norm(), 1e-6) << "asking does not move it";
  filter.reset();
  EXPECT_FALSE(filter.predict(1));
  filter.update(far, said, 0.5);
  EXPECT_LT(between(far, filter.predict(1)->T_camera_model).norm(), 1e-12) << "and no velocity is left";
}

TEST(MotionFilter, RefusesTimesThatFallAndPosesThatAreNone) {
  test::Random random(6);
  const Pose T = somePose(random);
  const Matrix6d said = 1e-8 * Matrix6d::Identity();
  MotionFilter filter({}, kCentroid);
  filter.update(T, said, 2);
  EXPECT_THAT(test::refusalOf([&] { filter.predict(1); }), testing::HasSubstr("time_s = 1: must not be before 2"));
  Pose mirrored = T;
  mirrored.linear().col(0) *= -1;
  EXPECT_THAT(test::refusalOf([&] { filter.update(mirrored, said, 3); }), testing::HasSubstr("rigid transform"));
  MotionFilterSettings still;
  still.acceleration_std_mm_per_s2 = 0;
  EXPECT_THAT(test::refusalOf([&] { MotionFilter(still, kCentroid); }),
              testing::HasSubstr("acceleration_std_mm_per_s2"));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/motion/motion_predictor.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <functional>
#include <limits>

#include "angio/simulation/patient_motion.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr double kPeriod_s = 1.0 / 15, kHorizon_s = 0.13;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
using Motion = std::function<Eigen::Vector3d(double time_s)>;

Eigen::Matrix3d diagonal(double x_mm, double y_mm, double z_mm) {
  return (1e-6 * Eigen::Vector3d(x_mm * x_mm, y_mm * y_mm, z_mm * z_mm)).asDiagonal();
}

// Breathing of 15 mm with breaths that differ, a heartbeat, a drift.
Motion patient(std::uint64_t seed, double heart_mm = 2, double period_s = 4) {
  MotionSettings s;
  s.breathing.amplitude_mm = 15;
  s.breathing.period_s = period_s;
  s.breathing.diaphragm_mm = 0;
  s.breathing.drift_mm_per_min = 3;
  s.heartbeat.amplitude_mm = heart_mm;
  s.heartbeat.center_mm[2] = 50;
  return [motion = PatientMotion(s, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity(), seed)](double t) {
    return motion.displacement(Eigen::Vector3d::Zero(), t);
  };
}

// A predictor fed frame by frame, and what became of its predictions.
struct Course {
  MotionPredictor predictor;
  test::Random random{1};
  double noise_mm = 0.2;
  double error2 = 0, held2 = 0, nees = 0;
  int scored = 0, changes = 0, suspects = 0;
  double worst_m = 0;

  // Errors are of all three axes, against a hold of the last measured value.
  void run(const Motion& motion, double from_s, double to_s, double score_from_s) {
    const Eigen::Matrix3d R = diagonal(noise_mm, noise_mm, noise_mm);
    for (auto k = static_cast<int>(std::lround(from_s / kPeriod_s)); k * kPeriod_s < to_s; ++k) {
      const double t = k * kPeriod_s;
      const Eigen::Vector3d seen = motion(t) + random.vector(1e-3 * noise_mm);
      const MotionUpdate update = predictor.update(t, seen, R);
      changes += update.status == MotionStatus::kChanged;
      suspects += update.status == MotionStatus::kSuspect;
      ASSERT_NE(update.status, MotionStatus::kRefused) << update.reason;
      const auto ahead = predictor.predict(t + kHorizon_s);
      ASSERT_TRUE(ahead);
      predictor.learn();
      if (t < score_from_s) continue;
      const Eigen::Vector3d truth = motion(t + kHorizon_s), error = ahead->position - truth;
      error2 += error.squaredNorm();
      held2 += (seen - truth).squaredNorm();
      nees += error.dot(ahead->covariance.inverse() * error);
      worst_m = std::max(worst_m, error.norm());
      ++scored;
    }
  }
  double rms_mm() const { return 1e3 * std::sqrt(error2 / scored); }
  double held_mm() const { return 1e3 * std::sqrt(held2 / scored); }
  double meanNees() const { return nees / scored; }
};

// What the filter's model can say exactly it predicts exactly, whatever frames are missing and however they are spaced.
TEST(MotionPredictor, IsExactOnASumOfHarmonics) {
  const double breath = 2 * kPi * 0.23, beat = 2 * kPi * 1.13;
  const auto motion = [&](double t) -> Eigen::Vector3d {
    return 1e-3 * (Eigen::Vector3d(2, -3, 40) + Eigen::Vector3d(0.05, 0, -0.02) * t +
                   Eigen::Vector3d(1, 3, 7) * std::cos(breath * t + 0.3) +
                   Eigen::Vector3d(0, 1, -2) * std::sin(2 * breath * t) +
                   Eigen::Vector3d(0.1, 0.3, 0.4) * std::cos(3 * breath * t + 1) +
                   Eigen::Vector3d(1, 0.5, 0.2) * std::sin(beat * t) +
                   Eigen::Vector3d(0.1, 0.3, 0.5) * std::cos(2 * beat * t - 1));
  };
  MotionPredictor predictor;
  test::Random random(3);
  double worst_m = 0, t = 0;
  while (t < 50) {
    t += kPeriod_s * random.uniform(0.6, 1.4) * (random.uniform(0, 1) < 0.15 ? 2 : 1);
    const MotionUpdate update = predictor.update(t, motion(t), diagonal(0.05, 0.05, 0.05));
    ASSERT_TRUE(update.status == MotionStatus::kTaken || t < 30) << t << " " << update.reason;
    predictor.learn();
    if (t < 30) continue;
    const auto ahead = predictor.predict(t + kHorizon_s);
    EXPECT_EQ(ahead->model, MotionModel::kHarmonic);
    worst_m = std::max(worst_m, (ahead->position - motion(t + kHorizon_s)).norm());
  }
  // The noise that keeps the filter awake lets it follow what it has not quite converged to.
  EXPECT_LT(1e3 * worst_m, 0.15);
  EXPECT_NEAR(*predictor.breathing_hz(), 0.23, 0.002);
  EXPECT_NEAR(*predictor.heart_hz(), 1.13, 0.01);
}

TEST(MotionPredictor, PredictsBreathingWithAHeartbeatAndKnowsHowWell) {
  double error2 = 0, held2 = 0, nees = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Course course;
    course.random = test::Random(seed);
    course.run(patient(seed), 0, 45, 12);
    EXPECT_NEAR(*course.predictor.breathing_hz(), 0.25, 0.01);
    EXPECT_NEAR(*course.predictor.heart_hz(), 70 / 60.0, 0.02);
    error2 += std::pow(course.rms_mm(), 2) / 6;
    held2 += std::pow(course.held_mm(), 2) / 6;
    nees += course.meanNees() / 6;
  }
  EXPECT_LT(std::sqrt(error2), 0.65);
  EXPECT_GT(std::sqrt(held2 / error2), 2.5);
  // 3 where the covariance is the error's; breaths that differ come in bursts, which no average foresees.
  EXPECT_GT(nees, 1.8);
  EXPECT_LT(nees, 4.5);
}

// What is seen badly along a direction that is no axis does not hide what is seen well across it.
TEST(MotionPredictor, FindsPeriodsAcrossAnObliqueBeam) {
  const Eigen::Vector3d beam = Eigen::Vector3d(0.4, 0.87, 0.3).normalized();
  const Eigen::Matrix3d R = diagonal(0.2, 0.2, 0.2) + 400e-6 * beam * beam.transpose();
  const Motion motion = patient(1);
  MotionPredictor predictor;
  test::Random random(1);
  double across2 = 0;
  int scored = 0;
  for (double t = 0; t < 40; t += kPeriod_s) {
    const Eigen::Vector3d seen = motion(t) + random.vector(0.2e-3) + 20e-3 * random.normal() * beam;
    ASSERT_NE(predictor.update(t, seen, R).status, MotionStatus::kRefused);
    predictor.learn();
    if (t < 20) continue;
    const auto ahead = predictor.predict(t + kHorizon_s);
    EXPECT_EQ(ahead->model, MotionModel::kHarmonic) << t;
    across2 += (ahead->position - motion(t + kHorizon_s)).cross(beam).squaredNorm();
    ++scored;
  }
  EXPECT_NEAR(*predictor.breathing_hz(), 0.25, 0.01);
  EXPECT_LT(1e3 * std::sqrt(across2 / scored), 0.75);
}

TEST(MotionPredictor, FindsOtherPeriodsToo) {
  for (const double period_s : {2.5, 3.3, 5.5}) {
    Course course;
    course.run(patient(4, 1, period_s), 0, 35, 20);
    EXPECT_NEAR(*course.predictor.breathing_hz(), 1 / period_s, 0.02 / period_s) << period_s;
    EXPECT_LT(course.rms_mm(), 0.5 * course.held_mm()) << period_s;
  }
}

// What has no rule is predicted no worse than by the last value.
TEST(MotionPredictor, IsNoWorseThanTheLastValueOnRandomSignals) {
  test::Random random(11);
  for (const double step_mm : {0.0, 0.3, 1.0}) {
    std::vector<Eigen::Vector3d> walk(1200, Eigen::Vector3d::Zero());
    for (std::size_t k = 1; k < walk.size(); ++k) walk[k] = walk[k - 1] + random.vector(1e-3 * step_mm);
    Course course;
    course.run([&](double t) { return walk[static_cast<std::size_t>(std::lround(t / kPeriod_s))]; }, 0, 70, 5);
    EXPECT_LT(course.rms_mm(), 1.1 * course.held_mm()) << step_mm;
  }
}

TEST(MotionPredictor, BeforeTwoBreathsItTakesNothingForPeriodic) {
  Course course;
  const Motion motion = patient(2, 0);
  EXPECT_FALSE(course.predictor.predict(0));
  for (double t = 0; t < 7.5; t += kPeriod_s) {
    const MotionUpdate update = course.predictor.update(t, motion(t), diagonal(0.2, 0.2, 0.2));
    ASSERT_NE(update.status, MotionStatus::kRefused);
    course.predictor.learn();
    const auto ahead = course.predictor.predict(t + kHorizon_s);
    ASSERT_TRUE(ahead);
    EXPECT_NE(ahead->model, MotionModel::kHarmonic) << t;
    // Within 4 of its own deviations, the speed of a breath that has just begun included.
    const Eigen::Vector3d error = ahead->position - motion(t + kHorizon_s);
    EXPECT_LT(error.dot(ahead->covariance.inverse() * error), 21) << t;
  }
}

TEST(MotionPredictor, ABreathHoldIsNoticed) {
  for (const double stop_s : {21.0, 22.0}) {  // In the middle of breathing in, and breathed in.
    const Motion breathing = patient(5, 1);
    Course course;
    course.run(breathing, 0, stop_s, stop_s);
    course.changes = 0;
    const Motion held = [&](double) { return breathing(stop_s); };
    course.run(held, stop_s, stop_s + 2, stop_s + 2);
    course.run(held, stop_s + 2, stop_s + 10, stop_s + 2);
    if (stop_s == 22) {  // The shallower one is followed as a breath that differs.
      EXPECT_GE(course.changes, 1);
    }
    EXPECT_LT(course.rms_mm(), 0.7);
    // And breathing again.
    course.error2 = course.scored = 0;
    course.run([&](double t) { return breathing(t - 10); }, stop_s + 10, stop_s + 40, stop_s + 25);
    EXPECT_LT(course.rms_mm(), 0.8);
  }
}

TEST(MotionPredictor, AShiftIsTakenOverAndOneWrongMeasurementIsNot) {
  const Motion breathing = patient(6);
  Course course;
  course.run(breathing, 0, 20, 20);
  const double wrong_s = 300 * kPeriod_s;
  const auto before = course.predictor.predict(wrong_s + kHorizon_s);
  const MotionUpdate wrong =
      course.predictor.update(wrong_s, breathing(wrong_s) + Eigen::Vector3d(0.03, 0, 0), diagonal(0.2, 0.2, 0.2));
  EXPECT_EQ(wrong.status, MotionStatus::kSuspect);
  // The drift's damping by steps is not that at once.
  EXPECT_LT((course.predictor.predict(wrong_s + kHorizon_s)->position - before->position).norm(), 1e-5);
  course.suspects = course.changes = 0;
  course.run(breathing, 301 * kPeriod_s, 25, 20.2);
  EXPECT_EQ(course.changes, 0);

  const Motion shifted = [&](double t) { return Eigen::Vector3d(breathing(t) + Eigen::Vector3d(0.02, 0.01, 0)); };
  course.suspects = course.changes = course.scored = 0;
  course.error2 = 0;
  course.run(shifted, 25, 26, 26);
  EXPECT_EQ(course.suspects, 1);
  EXPECT_EQ(course.changes, 1);
  course.run(shifted, 26, 35, 26);
  EXPECT_LT(course.rms_mm(), 0.8) << "how it breathes has not been forgotten";
}

TEST(MotionPredictor, WhatIsNoMeasurementIsRefusedAndChangesNothing) {
  const Motion motion = patient(1);
  Course course;
  course.run(motion, 0, 12, 12);
  const Eigen::Vector3d here = motion(12);
  const Eigen::Matrix3d R = diagonal(0.2, 0.2, 0.2);
  const auto before = course.predictor.predict(12.1);
  Eigen::Matrix3d broken = R;
  broken(0, 0) = kNan;
  Eigen::Matrix3d negative = R;
  negative(2, 2) = -1;
  Eigen::Matrix3d skewed = R;
  skewed(0, 1) = 1e-6;
  const auto refused = [&](double t, const Eigen::Vector3d& p, const Eigen::Matrix3d& C) {
    return course.predictor.update(t, p, C).status == MotionStatus::kRefused;
  };
  EXPECT_TRUE(refused(kNan, here, R));
  EXPECT_TRUE(refused(12.1, Eigen::Vector3d(0, kNan, 0), R));
  for (const auto& C : {broken, negative, skewed}) EXPECT_TRUE(refused(12.1, here, C));
  EXPECT_TRUE(refused(5, here, R)) << "late";
  EXPECT_EQ(course.predictor.predict(12.1)->position, before->position);
  EXPECT_EQ(course.predictor.predict(12.1)->covariance, before->covariance);
  EXPECT_FALSE(course.predictor.predict(kNan));
  EXPECT_FALSE(course.predictor.predict(5));
  EXPECT_EQ(course.predictor.update(12.1, here, Eigen::Matrix3d::Zero()).status == MotionStatus::kRefused, false);
}

TEST(MotionPredictor, BeyondItsHorizonItKeepsTheLastEstimateLessAndLessSurely) {
  const Motion motion = patient(1);
  Course course;
  course.run(motion, 0, 20, 20);
  const double last_s = 299 * kPeriod_s;
  const auto now = course.predictor.predict(last_s), near = course.predictor.predict(last_s + 0.69),
             far = course.predictor.predict(last_s + 0.71), farther = course.predictor.predict(last_s + 5);
  EXPECT_FALSE(near->beyond_horizon);
  EXPECT_TRUE(far->beyond_horizon && farther->beyond_horizon);
  EXPECT_EQ(far->position, now->position);
  EXPECT_EQ(farther->position, now->position);
  EXPECT_GT(far->covariance.trace(), now->covariance.trace());
  EXPECT_GT(farther->covariance.trace(), 10 * far->covariance.trace());
  // After a gap everything begins anew.
  const MotionUpdate after = course.predictor.update(last_s + 4, motion(0), diagonal(0.2, 0.2, 0.2));
  EXPECT_EQ(after.status, MotionStatus::kChanged);
  EXPECT_FALSE(course.predictor.breathing_hz());
}

TEST(MotionPredictor, AClockThatWasSetBackIsBelievedInTheEnd) {
  const Motion motion = patient(1);
  Course course;
  course.run(motion, 0, 20, 20);
  int refused = 0;
  MotionUpdate update;
  for (int k = 0; k < 5; ++k) {
    update = course.predictor.update(3 + k * kPeriod_s, motion(3 + k * kPeriod_s), diagonal(0.2, 0.2, 0.2));
    refused += update.status == MotionStatus::kRefused;
  }
  EXPECT_EQ(refused, 3);
  EXPECT_EQ(update.status, MotionStatus::kTaken);
  EXPECT_TRUE(course.predictor.predict(3.5));
}

// A prediction that somebody waits for does not wait for the search.
TEST(MotionPredictor, LooksForPeriodsOnlyWhenItIsTold) {
  const Motion motion = patient(1);
  MotionPredictor predictor;
  predictor.learn();  // Nothing from nothing.
  for (int k = 0; k * kPeriod_s < 20; ++k) {
    ASSERT_NE(predictor.update(k * kPeriod_s, motion(k * kPeriod_s), diagonal(0.2, 0.2, 0.2)).status,
              MotionStatus::kRefused);
  }
  EXPECT_FALSE(predictor.breathing_hz());
  predictor.learn();
  EXPECT_NEAR(predictor.breathing_hz().value_or(0), 0.25, 0.01);
}

TEST(MotionPredictor, RepeatsItself) {
  Course a, b;
  a.run(patient(3), 0, 25, 10);
  b.run(patient(3), 0, 25, 10);
  EXPECT_EQ(a.error2, b.error2);
  EXPECT_EQ(a.nees, b.nees);
  a.predictor.reset();
  EXPECT_FALSE(a.predictor.predict(30));
}

TEST(MotionPredictor, RefusesSettingsOutOfRange) {
  MotionPredictorSettings settings;
  settings.memory_s = kNan;
  EXPECT_NE(test::refusalOf([&] { MotionPredictor{settings}; }).find("memory_s"), std::string::npos);
  settings = {};
  settings.breathing_low_hz = 0.7;
  EXPECT_NE(test::refusalOf([&] { MotionPredictor{settings}; }).find("breathing_low_hz = 0.7"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

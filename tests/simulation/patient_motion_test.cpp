// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/patient_motion.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/base/errors.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

MotionSettings everything() {
  MotionSettings s;
  s.breathing.amplitude_mm = 15;
  s.breathing.drift_mm_per_min = 4;
  s.heartbeat.amplitude_mm = 6;
  s.shift.drift_mm_per_min[0] = 3;
  s.shift.sudden_mm[1] = 5;
  s.shift.sudden_turn_deg = 2;
  return s;
}

const Eigen::Matrix3d kTurned = expSO3({0.3, -1.1, 0.4});
const Eigen::Vector3d kCenter(0.1, 0.2, -0.05);

TEST(PatientMotion, NothingHasMovedAtTimeZero) {
  const PatientMotion motion(everything(), kCenter, kTurned, 7);
  test::Random random(1);
  for (int i = 0; i < 20; ++i) {
    EXPECT_LT(motion.displacement(kCenter + random.vector(0.1), 0).norm(), 1e-12);
  }
  EXPECT_LT((motion.shift(0).matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-12);
  EXPECT_TRUE(motion.moves());
  EXPECT_FALSE(PatientMotion({}, kCenter, kTurned, 7).moves());
}

// Over many seeds, since four waves over a tree's extent are few.
TEST(PatientMotion, DeformsByTheSameAtAllTimes) {
  MotionSettings settings;
  settings.deformation.rms_mm = 4;
  test::Random random(2);
  double squares_mm2 = 0;
  constexpr int kSeeds = 200;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const PatientMotion motion(settings, kCenter, kTurned, static_cast<std::uint64_t>(seed));
    EXPECT_TRUE(motion.moves());
    const Eigen::Vector3d at = kCenter + random.vector(0.1), deformed = motion.displacement(at, 0);
    EXPECT_EQ(deformed, motion.displacement(at, 3.2));
    squares_mm2 += 1e6 * deformed.squaredNorm() / kSeeds;
  }
  EXPECT_NEAR(std::sqrt(squares_mm2), 4, 0.4);
}

TEST(PatientMotion, IsSmoothInSpaceAndTimeAndTheSameAgain) {
  const PatientMotion motion(everything(), kCenter, kTurned, 7), again(everything(), kCenter, kTurned, 7);
  test::Random random(2);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d p = kCenter + random.vector(0.15), near = p + 1e-3 * random.direction();
    const double t = random.uniform(0, 30);
    const Eigen::Vector3d moved = motion.displacement(p, t);
    EXPECT_EQ(again.displacement(p, t), moved);
    // Less than a third of a millimetre over one: 15 mm that fall off over 110 mm, and 6 mm with a turn over 50 mm.
    EXPECT_LT((motion.displacement(near, t) - moved).norm(), 0.35e-3);
    // Within a millisecond, a tenth of a millimetre: the heart's 6 mm go in a seventh of a second.
    EXPECT_LT((motion.displacement(p, t + 1e-3) - moved).norm(), 0.15e-3);
  }
}

TEST(PatientMotion, BreathingGoesDownAndForwardAndBackAnotherWay) {
  MotionSettings s;
  s.breathing.amplitude_mm = 20;
  s.breathing.variation = 0;
  s.breathing.diaphragm_mm = 0;
  const PatientMotion motion(s, kCenter, kTurned, 1);
  const auto inPatient = [&](double t) { return Eigen::Vector3d(kTurned * motion.displacement(kCenter, t)); };
  // Half a period in: 20 mm towards the feet; forward it lags a tenth of the period, sin^4(0.4 pi) of 6 mm.
  const double forward = 6e-3 * (std::pow(std::sin(0.4 * kPi), 4) - std::pow(std::sin(0.9 * kPi), 4));
  EXPECT_LT((inPatient(2) - Eigen::Vector3d(0, -forward, -20e-3)).norm(), 1e-9);
  EXPECT_NEAR(inPatient(1.2).z(), inPatient(2.8).z(), 1e-9);           // The same height on the way in and out...
  EXPECT_GT(std::abs(inPatient(1.2).y() - inPatient(2.8).y()), 2e-3);  // ...another place.
  // It falls off below the diaphragm: to exp(-1/2) after 110 mm.
  const Eigen::Vector3d low = kCenter - 0.11 * kTurned.transpose().col(2);
  EXPECT_NEAR((kTurned * motion.displacement(low, 2)).z(), -20e-3 * std::exp(-0.5), 1e-9);
}

TEST(PatientMotion, BreathsDifferByTheirVariation) {
  MotionSettings s;
  s.breathing.amplitude_mm = 10;
  s.breathing.variation = 0.2;
  s.breathing.diaphragm_mm = 0;
  const PatientMotion motion(s, {0, 0, 0}, Eigen::Matrix3d::Identity(), 3);
  double sum = 0, squares = 0;
  constexpr int kBreaths = 400;
  for (int i = 0; i < kBreaths; ++i) {
    const double depth = -motion.displacement({0, 0, 0}, 4.0 * i + 2).z() / 10e-3;
    sum += depth;
    squares += depth * depth;
  }
  const double mean = sum / kBreaths;
  EXPECT_NEAR(mean, 1, 0.04);                                           // Four deviations of a mean.
  EXPECT_NEAR(std::sqrt(squares / kBreaths - mean * mean), 0.2, 0.03);  // The same of a deviation.
}

TEST(PatientMotion, HeartbeatMovesByItsAmplitudeAtMost) {
  MotionSettings s;
  s.heartbeat.amplitude_mm = 5;
  s.heartbeat.turn_deg = 0;
  s.heartbeat.rate_per_min = 60;
  const PatientMotion motion(s, {0, 0, 0}, Eigen::Matrix3d::Identity(), 3);
  const Eigen::Vector3d p(0.05, 0, 0);  // At its reach.
  EXPECT_NEAR(motion.displacement(p, 1.0 / 6).x(), -5e-3, 1e-9);
  EXPECT_EQ(motion.displacement(p, 0.5).norm(), 0);
  EXPECT_EQ(motion.displacement({0, 0, 0}, 1.0 / 6).norm(), 0);
}

TEST(PatientMotion, ASuddenShiftTurnsAboutTheTree) {
  MotionSettings s;
  s.shift.sudden_mm[0] = 10;
  s.shift.sudden_turn_deg = 30;
  const PatientMotion motion(s, kCenter, kTurned, 1);
  EXPECT_TRUE(motion.shift(4.99).isApprox(Pose::Identity(), 1e-12));
  const Pose T = motion.shift(5);
  EXPECT_LT((kTurned * (T * kCenter - kCenter) - Eigen::Vector3d(0.01, 0, 0)).norm(), 1e-12);
  EXPECT_LT((kTurned * logSO3(T.linear()) - Eigen::Vector3d(0, 0, degToRad(30))).norm(), 1e-9);
  EXPECT_THROW(PatientMotion(
                   [] {
                     MotionSettings wrong;
                     wrong.breathing.period_s = 0;
                     return wrong;
                   }(),
                   kCenter, kTurned, 1),
               InputError);
}

// A measured motion deforms the patient's vessels by what is asked for, at all times, and holds no pose; a breath adds.
TEST(SimulatedPatient, IsDeformedByAMeasuredMotionAtAllTimes) {
  const auto measured = std::make_shared<MeasuredMotion>();
  measured->points.resize(3, 1000);
  measured->displacements_m.setZero(3, 1000);
  for (int i = 0; i < 1000; ++i) {
    measured->points.col(i) = 0.03 * Eigen::Vector3d(i % 10, i / 10 % 10, i / 100);
    measured->displacements_m(2, i) = std::pow(measured->points(0, i) - 0.15, 2);
  }
  const VesselTree tree = readVesselTree(exampleData("hepatic-tace/tree.csv"));
  SimulatedPatientSettings settings;
  settings.motion.deformation = {3, measured};
  const SimulatedPatient patient(tree, settings);
  const Eigen::Matrix3Xd d = *patient.scene(Pose::Identity(), 0).displacements_m;
  EXPECT_NEAR(std::sqrt(d.squaredNorm() / static_cast<double>(d.cols())), 3e-3, 1e-9);
  EXPECT_LT(d.rowwise().mean().norm(), 1e-6) << "no shift is left in it";
  EXPECT_EQ(d, *patient.scene(Pose::Identity(), 3.2).displacements_m);
  for (const int i : {0, 100, 300}) {
    EXPECT_LT((patient.moved(tree.points().col(i), 1) - tree.points().col(i) - d.col(i)).norm(), 1e-9);
  }
  settings.fluoroscopy.seed += 1;
  EXPECT_GT((*SimulatedPatient(tree, settings).scene(Pose::Identity(), 0).displacements_m - d).norm(), 0.1 * d.norm());
  settings.fluoroscopy.seed -= 1;
  settings.motion.breathing.amplitude_mm = 10;
  const Eigen::Matrix3Xd both = *SimulatedPatient(tree, settings).scene(Pose::Identity(), 2).displacements_m;
  settings.motion.deformation = {};
  const Eigen::Matrix3Xd breath = *SimulatedPatient(tree, settings).scene(Pose::Identity(), 2).displacements_m;
  EXPECT_LT((both - breath - d).norm(), 1e-9 * std::sqrt(static_cast<double>(d.size())));
  EXPECT_GT(breath.norm(), 1e-3);
}

// The known displacement is the one that the image shows.
TEST(PatientMotion, TheImageMovesAsTheTruthSays) {
  SimulatedPatientSettings settings;
  settings.fluoroscopy = test::withoutNoise(test::bare());
  settings.motion.breathing.amplitude_mm = 12;
  settings.motion.breathing.diaphragm_mm = 0;
  settings.motion.shift.sudden_mm[1] = 4;
  settings.motion.shift.sudden_at_s = 1;
  SimulatedPatient patient(test::straight(2e-3), settings,
                           {(Eigen::Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished(), {}});
  const XrayCamera camera = test::smallCamera();
  const auto rowOf = [&](const XrayScene& scene) {
    const cv::Mat image = patient.render(camera, scene, 0);
    double mass = 0, moment = 0;
    for (int y = 0; y < image.rows; ++y) {
      const double dark = settings.fluoroscopy.background_level - image.at<std::uint16_t>(y, 256);
      mass += dark;
      moment += dark * y;
    }
    return moment / mass;
  };
  const XrayScene rest = patient.scene(test::inView(), 0), moved = patient.scene(test::inView(), 2);
  const Eigen::Vector3d middle = 0.5 * (patient.tree().points().col(0) + patient.tree().points().col(1));
  const Eigen::Vector3d by = 0.5 * (moved.displacements_m->col(0) + moved.displacements_m->col(1));
  const Eigen::Vector2d expected = *camera.project(moved.T_camera_model * (middle + by));
  EXPECT_NEAR(rowOf(moved) - rowOf(rest), expected.y() - 255.5, 0.05);
  EXPECT_GT(std::abs(expected.y() - 255.5), 30);
}

}  // namespace
}  // namespace angio::test

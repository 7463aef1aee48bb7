// SPDX-License-Identifier: GPL-2.0-or-later
// Cameras that see a phantom whose plates are shifted, through a grid's map that has turned since.
#include "angio/calibration/plated_cameras.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "angio/calibration/picture_views.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/test/errors.hpp"
#include "cube_scenes.hpp"
#include "map_turn.hpp"

namespace angio::test {
namespace {

constexpr double kBeadNoise_px = 0.1, kTolerance_mm = 0.3;

// An intensifier's pincushion of some pixels as a grid's polynomial of the third order.
DetectorDistortion gridMap() {
  DisplacementPolynomial shift{3, Eigen::Matrix2Xd::Zero(2, DisplacementPolynomial::termCount(3))};
  shift.coefficients_px(0, 6) = 12;
  shift.coefficients_px(1, 9) = 12;
  shift.coefficients_px(0, 8) = 9;
  shift.coefficients_px(1, 7) = 9;
  return DetectorDistortion::polynomial({511.5, 511.5}, 560, shift);
}

Pose secondView() {
  Pose T = cubeView();
  T.linear() = expSO3({0, degToRad(93), 0}) * cubeView().linear();
  T.translation() = Eigen::Vector3d(-0.01, 0.02, 0.9) - T.linear() * cubePhantom().center_m();
  return T;
}

Eigen::VectorXd someShifts_mm(Random& random) {
  Eigen::VectorXd shifts(12);
  for (Eigen::Index k = 0; k < 12; ++k) shifts[k] = kTolerance_mm * random.normal();
  return shifts;
}

// What a camera sees of the cube with its four plates along x shifted.
CameraViews seenBy(const Pose& T, double turn_rad, const Eigen::VectorXd& shifts_mm, Random& random) {
  const DetectorDistortion shown = turnedMap(gridMap(), turn_rad);
  const BeadPhantom cube = cubePhantom();
  CameraViews camera{{1024, 1024, {}, gridMap(), {}, true}, {{"view", {}, {}, false, CArmJoints::Zero()}}};
  for (int i = 0; i < 64; ++i) {
    const Eigen::Vector3d shift_m = 1e-3 * shifts_mm.segment<3>(3 * (i % 4));
    const auto px = cubeCamera().project(T * (cube.beads[static_cast<std::size_t>(i)].position_m + shift_m));
    const Eigen::Vector2d seen = shown.distorted(px.value());
    const double y = random.normal(), x = random.normal();
    if (seen.minCoeff() < 10 || seen.maxCoeff() > 1013) continue;
    camera.views.front().beads.push_back({i, seen + kBeadNoise_px * Eigen::Vector2d(x, y), 1});
  }
  return camera;
}

std::vector<CameraViews> bothCameras(const Eigen::VectorXd& shifts_mm, Random& random) {
  return {seenBy(cubeView(), degToRad(0.17), shifts_mm, random),
          seenBy(secondView(), degToRad(-0.3), shifts_mm, random)};
}

TEST(MapTurn, GrowsWithTheSquareOfTheRadius) {
  const DetectorDistortion map = gridMap(), turned = turnedMap(map, 0.01);
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(200, 300), Eigen::Vector2d(700, 520), Eigen::Vector2d(511, 900)}) {
    const Eigen::Vector2d p = (px - map.center_px) / 560;
    const Eigen::Vector2d moved = 0.01 * 560 * p.squaredNorm() * Eigen::Vector2d(-p.y(), p.x());
    EXPECT_LT((turned.distorted(px) - map.distorted(px) - moved).norm(), 1e-9);
  }
}

// Shifts are drawn as they are said to be, so the claims must hold on average.
TEST(PlatedCameras, CovariancesAreThoseOfTheErrors) {
  Random random(5);
  constexpr int kTrials = 40;
  const Pose T_true = secondView() * cubeView().inverse();
  double nees_pose = 0, nees_lens = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const std::vector<CameraViews> cameras = bothCameras(someShifts_mm(random), random);
    const PlatedCameras found =
        calibrateCameras(cubePhantom(), cameras, {}, PhantomBuild::kPlatesAlongX, kTolerance_mm, true);
    const CameraCalibration& first = found.cameras[0];
    const RelativePose relative = relativePose(first.views[0], found.cameras[1].views[0], first.plates);
    Vector6d error;
    error << relative.T_second_first.translation() - T_true.translation(),
        logSO3(relative.T_second_first.linear() * T_true.linear().transpose());
    nees_pose += squaredMahalanobis(error, relative.covariance) / kTrials;
    Eigen::VectorXd lens = first.record.values.head<5>();
    lens -= (Eigen::VectorXd(5) << 4450, 4450, 480, 560, 0.17).finished();
    nees_lens += squaredMahalanobis(lens, Eigen::MatrixXd(first.record.covariance.topLeftCorner(5, 5))) / kTrials;
  }
  // Means of 40 of chi-square of 6 and 5: 99 % lie within these. Noise is measured by some dozens of residuals, and a
  // claim by so few is optimistic by a tenth, which the upper bounds allow.
  EXPECT_GT(nees_pose, 4.7);
  EXPECT_LT(nees_pose, 8.2);
  EXPECT_GT(nees_lens, 3.8);
  EXPECT_LT(nees_lens, 7.1);
}

TEST(PlatedCameras, ThePlatesAreFoundByBeadsThatAreLeftOut) {
  Random random(6);
  const Eigen::VectorXd shifts_mm = someShifts_mm(random);
  const PlatedCameras found =
      calibrateCameras(cubePhantom(), bothCameras(shifts_mm, random), {}, std::nullopt, kTolerance_mm, true);
  ASSERT_EQ(found.trials.size(), 4u);
  EXPECT_EQ(found.build, PhantomBuild::kPlatesAlongX);
  for (const CameraCalibration& camera : found.cameras) {
    EXPECT_LT(camera.record.residual_rms, 1.2 * std::sqrt(2) * kBeadNoise_px);
    EXPECT_LT(camera.left_out_rms_px,
              2 * std::sqrt(2) * kBeadNoise_px);  // Some 27 beads for 23 numbers: twice the noise.
    EXPECT_GT(camera.left_out_rms_px, camera.record.residual_rms);
  }
  const BuildTrial &one_piece = found.trials[0], &plates = found.trials[1];
  EXPECT_GT(one_piece.left_out_rms_px, 2 * plates.left_out_rms_px);
  // What one camera has found of the shifts holds for the other.
  EXPECT_LT(plates.other_rms_px, 0.8 * one_piece.rms_px);
}

// A freer model must not win by following the noise.
TEST(PlatedCameras, AWholePhantomIsLeftWhole) {
  Random random(7);
  for (int trial = 0; trial < 5; ++trial) {
    const std::vector<CameraViews> cameras = bothCameras(Eigen::VectorXd::Zero(12), random);
    const PlatedCameras found = calibrateCameras(cubePhantom(), cameras, {}, std::nullopt, kTolerance_mm, true);
    EXPECT_EQ(found.build, PhantomBuild::kOnePiece) << trial;
  }
}

// The gain of the map's error is that of a calibration with another map.
TEST(CameraCalibration, TheMapsErrorIsCarriedOver) {
  Random random(8);
  CameraViews camera = seenBy(cubeView(), 0, Eigen::VectorXd::Zero(12), random);
  // Beyond the map's circle, where no intensifier shows anything, its error is taken as that of the rim.
  std::vector<SeenBead>& beads = camera.views.front().beads;
  beads.erase(std::remove_if(
                  beads.begin(), beads.end(),
                  [](const SeenBead& bead) { return (bead.center_px - Eigen::Vector2d(511.5, 511.5)).norm() > 540; }),
              beads.end());
  const Eigen::Index terms = DisplacementPolynomial::termCount(3);
  Eigen::VectorXd step(terms);
  for (Eigen::Index k = 0; k < terms; ++k) step[k] = 0.02 * random.normal();
  const auto solved = [&](double share, int axis) {
    CameraViews other = camera;
    other.detector.distortion->shift.coefficients_px.row(axis) += share * step.transpose();
    return calibrateCamera(cubePhantom(), other.detector, other.views);
  };
  Eigen::MatrixXd wanted = Eigen::MatrixXd::Zero(6, 6);
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::VectorXd change = 0.5 * (solved(1, axis).record.values - solved(-1, axis).record.values);
    wanted += change * change.transpose();
  }
  const Eigen::MatrixXd without = solved(0, 0).record.covariance;
  camera.detector.map_covariance_px2 = step * step.transpose();
  const Eigen::MatrixXd added = solved(0, 0).record.covariance - without;
  // To first order, with residuals of a tenth of a pixel.
  EXPECT_LT((added - wanted).norm(), 0.02 * wanted.norm());
  EXPECT_GT(wanted.diagonal().minCoeff(), 0);
}

TEST(PhantomPlates, AreStackedAlongAnAxisOrRefused) {
  const PhantomPlates plates = platesAlong(cubePhantom(), 2, 0.3);
  ASSERT_EQ(plates.count, 4);
  EXPECT_EQ(plates.plate_of_bead[0], 0);
  EXPECT_EQ(plates.plate_of_bead[63], 3);
  BeadPhantom helix = cubePhantom();
  for (std::size_t i = 0; i < 64; ++i) helix.beads[i].position_m.z() = 0.003 * static_cast<double>(i);
  EXPECT_TRUE(platesAlong(helix, 2, 0.3).isOnePiece());
  const auto forced = [&] { calibrateCameras(helix, {}, {}, PhantomBuild::kPlatesAlongZ, 0.3, true); };
  EXPECT_NE(test::refusalOf(forced).find("plates"), std::string::npos);
}

// Information adds, and what both have from before counts once: two looks at one number.
TEST(PhantomPlates, JointShiftsWeighBothEstimates) {
  const auto of = [](double mean, double variance) {
    return PlateShifts{Eigen::VectorXd::Constant(1, mean), Eigen::MatrixXd::Constant(1, 1, variance)};
  };
  // Measured as 2 and 4 with variance 1 each, known before as 0 with variance 1: 2 / 2 and 4 / 2; together 6 / 3.
  const PlateShifts joint = jointShifts(of(0, 1), of(1, 0.5), of(2, 0.5));
  EXPECT_NEAR(joint.mean_mm[0], 2, 1e-12);
  EXPECT_NEAR(joint.covariance_mm2(0, 0), 1.0 / 3, 1e-12);
}

}  // namespace
}  // namespace angio::test

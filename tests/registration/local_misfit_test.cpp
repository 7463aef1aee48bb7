// SPDX-License-Identifier: GPL-2.0-or-later
#include "local_misfit.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr double kDepth_m = 0.8, kHalf_m = 30e-3;
constexpr int kVesselPoints = 61;

// A vessel of 60 mm along an axis about the middle of the beam.
VesselTree vesselAlong(const Eigen::Vector3d& axis) {
  Eigen::Matrix3Xd points(3, kVesselPoints);
  std::vector<int> parents;
  for (int i = 0; i < kVesselPoints; ++i) {
    points.col(i) = (2.0 * i / (kVesselPoints - 1) - 1) * kHalf_m * axis;
    parents.push_back(i - 1);
  }
  return {points, parents};
}

// What a camera sees of places: one branch.
Centerline2d imageOf(const Eigen::Matrix3Xd& points, const XrayCamera& camera, const Pose& T) {
  Eigen::Matrix2Xd pixels(2, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) pixels.col(i) = *camera.project(T * points.col(i));
  return densified(makeCenterline(pixels, std::vector<int>(static_cast<std::size_t>(points.cols()), 0)), 1);
}

Pose facingTheVessel() { return Pose(Eigen::Translation3d(0, 0, kDepth_m)); }

Pose turnedFrom(const Eigen::Vector3d& axis_angle) {
  Pose turn = Pose::Identity();
  turn.linear() = expSO3(axis_angle);
  return Eigen::Translation3d(0, 0, kDepth_m) * turn * Eigen::Translation3d(0, 0, -kDepth_m);
}

const XrayCamera kCamera = clinicalCamera();

double pixel_m() { return kDepth_m / kCamera.parameters().fx_px; }

// The far half of a vessel was fitted 8 px beside its image: it is off by that across the beam, less what counts as
// seen, and nothing is said along the beam nor of the other half.
TEST(LocalMisfit, IsTheDistanceToTheImageAcrossTheBeam) {
  const VesselTree tree = vesselAlong(Eigen::Vector3d::UnitX());
  const OrientedModel model(tree, OrientedKernelSettings());
  const Centerline2d image = imageOf(tree.points(), kCamera, facingTheVessel());
  const XrayViews views{XrayView{image, kCamera}};
  Eigen::Matrix3Xd displaced = model.points;
  for (Eigen::Index i = 0; i < displaced.cols(); ++i) displaced(1, i) += displaced(0, i) > 0 ? 8 * pixel_m() : 0;
  const LocalMisfit misfit(views, model, displaced, facingTheVessel(), true);
  const Eigen::Matrix3d off = misfit.covarianceAt({20e-3, 0, 0}), fits = misfit.covarianceAt({-20e-3, 0, 0});
  const double expected_m2 = (8 * 8 - 2 * 2) * pixel_m() * pixel_m();
  // A mean over vessel whose beam turns by some hundredths of a radian.
  EXPECT_NEAR(off(1, 1), expected_m2, 0.03 * expected_m2);
  EXPECT_LT(off(2, 2), 0.01 * expected_m2);
  EXPECT_LT(fits.norm(), 1e-3 * expected_m2);
  EXPECT_EQ(misfit.covarianceAt({0, 0.1, 0}).norm(), 0) << "far from the tree";
}

// Another vessel that crosses where the tree was fitted is no image of it.
TEST(LocalMisfit, ACrossingVesselIsNoImage) {
  const VesselTree across = vesselAlong(Eigen::Vector3d::UnitY()), tree = vesselAlong(Eigen::Vector3d::UnitX());
  const OrientedModel model(tree, OrientedKernelSettings());
  const Centerline2d image = imageOf(across.points(), kCamera, facingTheVessel());
  const XrayViews views{XrayView{image, kCamera}};
  const LocalMisfit misfit(views, model, model.points, facingTheVessel(), true);
  // The furthest that is looked for.
  const double expected_m2 = (15 * 15 - 2 * 2) * pixel_m() * pixel_m();
  EXPECT_NEAR(misfit.covarianceAt(Eigen::Vector3d::Zero())(1, 1), expected_m2, 0.03 * expected_m2);
  const LocalMisfit seen_alone(views, model, model.points, facingTheVessel(), false);
  EXPECT_EQ(seen_alone.covarianceAt(Eigen::Vector3d::Zero()).norm(), 0);
}

// What the collimator hides has no image, and nothing is said of it.
TEST(LocalMisfit, TheCollimatorHidesNothingThatIsOff) {
  const VesselTree tree = vesselAlong(Eigen::Vector3d::UnitX()), across = vesselAlong(Eigen::Vector3d::UnitY());
  const OrientedModel model(tree, OrientedKernelSettings());
  const Centerline2d image = imageOf(across.points(), kCamera, facingTheVessel());
  XrayView view{image, kCamera};
  view.collimator_px = {{0, 0}, {512, 0}, {512, 1023}, {0, 1023}};
  const LocalMisfit misfit({view}, model, model.points, facingTheVessel(), true);
  EXPECT_GT(misfit.covarianceAt({-20e-3, 0, 0})(1, 1), 0);
  EXPECT_EQ(misfit.covarianceAt({20e-3, 0, 0}).norm(), 0);
}

// A second plane sees what is off along the first one's beam.
TEST(LocalMisfit, EveryViewSaysWhatIsOffAcrossItsOwnBeam) {
  const VesselTree tree = vesselAlong(Eigen::Vector3d::UnitX());
  const OrientedModel model(tree, OrientedKernelSettings());
  const Pose T_second_first = turnedFrom({kPi / 2, 0, 0});
  Eigen::Matrix3Xd displaced = model.points;
  displaced.row(2).array() += 8 * pixel_m();
  const Centerline2d in_first = imageOf(tree.points(), kCamera, facingTheVessel());
  const Centerline2d in_second = imageOf(tree.points(), kCamera, T_second_first * facingTheVessel());
  const XrayView first{in_first, kCamera}, second{in_second, kCamera, T_second_first};
  const auto along_m2 = [&](const XrayViews& views) {
    return LocalMisfit(views, model, displaced, facingTheVessel(), true).covarianceAt(Eigen::Vector3d::Zero())(2, 2);
  };
  const double expected_m2 = (8 * 8 - 2 * 2) * pixel_m() * pixel_m();
  EXPECT_LT(along_m2({first}), 0.01 * expected_m2);
  EXPECT_NEAR(along_m2({first, second}), expected_m2, 0.03 * expected_m2);
}

}  // namespace
}  // namespace angio::test

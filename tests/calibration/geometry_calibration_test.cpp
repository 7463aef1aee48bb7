// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/geometry_calibration.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/calibration/calibration_simulation.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr double kNoise_px = 0.1;
const Eigen::Vector4d kCameraSigma_px(1.2, 1.2, 1, 0.8);

BeadPhantom helix() {
  BeadPhantom phantom;
  phantom.name = "helix";
  for (int i = 0; i < 60; ++i) {
    const double angle = 8 * kPi * i / 59;
    phantom.beads.push_back({{0.045 * std::cos(angle), 0.045 * std::sin(angle), 0.13 * (i / 59.0 - 0.5)}, 8e-4});
  }
  return phantom;
}

struct Scene {
  BeadPhantom phantom = helix();
  SimulatedDevice machine;
  GeometryCamera camera;
  std::vector<BeadView> views;
};

std::vector<BeadView> seen(const std::vector<SimulatedBeadView>& views, test::Random& random) {
  std::vector<BeadView> result;
  for (const SimulatedBeadView& view : views) {
    BeadView& taken = result.emplace_back();
    taken.name = "v" + std::to_string(result.size());
    taken.joints = view.said;
    taken.source_detector_distance_m = view.source_detector_distance_m;
    taken.held_out = view.held_out;
    for (std::size_t i = 0; i < view.shown.size(); ++i) {
      const Eigen::Vector2d noise = kNoise_px * random.vector(1).head<2>();
      taken.beads.push_back({view.shown[i], view.pixels_px.col(static_cast<Eigen::Index>(i)) + noise});
    }
  }
  return result;
}

Scene sceneOf(CalibrationSimulationSettings settings) {
  test::Random random(static_cast<unsigned>(settings.seed));
  Scene scene;
  scene.machine = simulatedMachine({}, Eigen::Vector3d::Zero(), settings);
  const CArmGeometry& carm = scene.machine.truth.carm;
  scene.views = seen(simulatedGeometryViews(scene.machine, scene.phantom, settings), random);
  scene.camera = {carm.camera().parameters(), Eigen::Matrix4d(kCameraSigma_px.cwiseAbs2().asDiagonal())};
  scene.camera.pixel_spacing_m = carm.pixel_spacing_m;
  scene.camera.source_detector_distance_m = carm.source_detector_distance_m;
  scene.camera.fx_px += kCameraSigma_px[0] * random.normal();
  scene.camera.fy_px += kCameraSigma_px[1] * random.normal();
  scene.camera.cx_px += kCameraSigma_px[2] * random.normal();
  scene.camera.cy_px += kCameraSigma_px[3] * random.normal();
  return scene;
}

CalibrationSimulationSettings rigid(int seed) {
  CalibrationSimulationSettings settings;
  settings.seed = seed;
  settings.flex_mm = settings.flex_deg = 0;
  return settings;
}

GeometryCalibration calibrate(const Scene& scene, const GeometrySettings& settings = {}) {
  return calibrateGeometry("views", scene.phantom, scene.camera, scene.views, settings);
}

std::string refusal(const Scene& scene) {
  return test::refusalOf([&] { calibrate(scene); });
}

TEST(GeometryCalibration, FindsTheArmWithinItsCovariance) {
  double sum = 0;
  int numbers = 0;
  for (int seed = 1; seed <= 12; ++seed) {
    const Scene scene = sceneOf(rigid(seed));
    const GeometryCalibration found = calibrate(scene);
    EXPECT_THAT(found.kept, testing::IsEmpty());
    EXPECT_NEAR(found.bead_std_px.value(), kNoise_px, 0.01);
    const auto truth = scene.machine.truth.carm.poseParameters();
    Eigen::VectorXd error(kCArmPoseParameters);
    std::vector<int> places;
    for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
      const CArmParameter& parameter = kCArmPoseParameterNames[k];
      ASSERT_EQ(found.record.parameters[k], parameter.name);
      const auto i = static_cast<Eigen::Index>(k);
      error[i] = found.record.values[i] - truth[i] / parameter.unit;
      places.push_back(static_cast<int>(k));
    }
    sum += squaredMahalanobis(error, Eigen::MatrixXd(found.record.covariance(places, places)));
    numbers += kCArmPoseParameters;
  }
  // Chi-square of 204 degrees of freedom: 0.72 to 1.34 in 999 of 1000. Encoders' noise turns about two axes while the
  // scatter that covers it has three, so that less than one is right as well.
  EXPECT_LT(sum / numbers, 1.34);
  EXPECT_GT(sum / numbers, 0.4);
}

TEST(GeometryCalibration, BendingIsTakenUpAndHeldOutViewsAgree) {
  CalibrationSimulationSettings settings;
  settings.seed = 3;
  const Scene scene = sceneOf(settings);
  const GeometryCalibration found = calibrate(scene);
  GeometrySettings stiff;
  stiff.flex = FlexModel::kNone;
  const GeometryCalibration without = calibrate(scene, stiff);
  EXPECT_LT(found.record.residual_rms, 0.5 * found.rms_without_flex);
  EXPECT_NEAR(found.rms_without_flex, without.record.residual_rms, 1e-6);
  EXPECT_LT(*found.record.held_out_rms, 0.7 * *without.record.held_out_rms);
  EXPECT_LT(found.pose_scatter_m, without.pose_scatter_m);
}

TEST(GeometryCalibration, AWrongViewIsNamedAndLeftOut) {
  Scene scene = sceneOf(rigid(4));
  const GeometryCalibration clean = calibrate(scene);
  scene.views[7].joints[0] += degToRad(1);
  const GeometryCalibration found = calibrate(scene);
  EXPECT_TRUE(found.record.views[7].outlier);
  EXPECT_THAT(found.doubts, Contains(HasSubstr("view v8 is left out")));
  EXPECT_NEAR(found.carm.source_isocenter_distance_m, clean.carm.source_isocenter_distance_m, 1e-3);
}

TEST(GeometryCalibration, WhatPositionsCannotTellIsKeptAndNamed) {
  Scene scene = sceneOf(rigid(5));
  std::vector<BeadView> views;
  for (const auto& view : scene.views) {
    if (view.joints.tail<3>().norm() < 1e-3) views.push_back(view);
  }
  scene.views = views;
  const GeometryCalibration found = calibrate(scene);
  EXPECT_TRUE(found.carm.deviations.table.isIdentity(0));
  EXPECT_EQ(found.carm.deviations.primary_offset_rad, 0);
  EXPECT_THAT(found.kept,
              Contains(HasSubstr("primary_offset_deg, table_xx, table_zx: kept, as the table's x moves by only")));
  EXPECT_THAT(found.kept, Contains(HasSubstr("table_zz: kept, as the table's z moves by only")));

  // One secondary angle: the axes' offsets cannot be known, and are not claimed to be.
  const auto carm = scene.machine.truth.carm;
  test::Random random(6);
  for (auto& view : scene.views) {
    view.joints[1] = degToRad(10);
    view.beads.clear();
    const Pose T = carm.T_camera_patient(view.joints) * scene.machine.T_patient_phantom;
    for (std::size_t i = 0; i < scene.phantom.beads.size(); ++i) {
      const Eigen::Vector2d noise = kNoise_px * random.vector(1).head<2>();
      view.beads.push_back(
          {static_cast<int>(i),
           *carm.camera(*view.source_detector_distance_m).project(T * scene.phantom.beads[i].position_m) + noise});
    }
  }
  EXPECT_THAT(calibrate(scene).kept, Contains(testing::AllOf(HasSubstr("axis_skew_deg stays near"),
                                                             HasSubstr("secondary angle spans 0 deg"))));
}

TEST(GeometryCalibration, HostileViewsAreRefusedByName) {
  const Scene sound = sceneOf(rigid(7));
  Scene scene = sound;
  for (auto& view : scene.views) view = scene.views[0];
  EXPECT_THAT(refusal(scene), HasSubstr("48 at 1 different positions"));

  scene = sound;
  for (auto& view : scene.views) view.joints[0] *= 0.05;
  EXPECT_THAT(refusal(scene), HasSubstr("must span at least 20 deg: the primary axis"));

  scene = sound;
  for (auto& view : scene.views) {
    for (auto& bead : view.beads) bead.bead = bead.bead == 3 ? 40 : bead.bead == 40 ? 3 : bead.bead;
  }
  EXPECT_THAT(refusal(scene), HasSubstr("beads = 3, 40: 2 of 60 beads lie elsewhere"));

  scene = sound;
  for (auto& bead : scene.phantom.beads) bead.position_m.x() *= -1;
  EXPECT_THAT(refusal(scene), HasSubstr("mirrored"));

  scene = sound;
  for (auto& view : scene.views) view.joints[0] *= -1;
  EXPECT_THAT(refusal(scene), HasSubstr("no C-arm explains the others: angles of another sign"));

  scene = sound;
  scene.views[4].beads.resize(5);
  EXPECT_THAT(refusal(scene), HasSubstr("v5 = 5 beads: there must be at least 8"));
}

TEST(GeometryCalibration, ViewsOfAnotherMachineAreTold) {
  Scene scene = sceneOf(rigid(8));
  const Scene other = sceneOf(rigid(9));
  for (std::size_t i = 0; i < scene.views.size(); i += 2) scene.views[i] = other.views[i];
  EXPECT_THAT(refusal(scene), HasSubstr("fit one another but not the other"));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include <algorithm>
#include <opencv2/core/mat.hpp>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/calibration_simulation.hpp"
#include "angio/calibration/pose_set.hpp"
#include "angio/calibration/view_set.hpp"
#include "angio/io/image_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

CArmCalibration nominal() { return readCArmCalibration(test::exampleData("hepatic-tace/carm.yaml")); }

TEST(SimulatedCalibrationData, ReadersTakeItAndTheTruthExplainsIt) {
  const test::TemporaryFolder folder;
  CalibrationSimulationSettings settings;
  settings.camera_views = 3;
  settings.geometry_views = 8;
  settings.distortion = SimulatedDistortion::kRadial;
  settings.encoder_noise_deg = settings.encoder_noise_mm = 0;
  writeCalibrationData(folder.path("set"), nominal(), Eigen::Vector3d::Zero(), settings, SimulatedImages::kNone);
  const BeadPhantom phantom = readBeadPhantom(folder.path("set/phantom.yaml"));
  const CArmCalibration truth = readCArmCalibration(folder.path("set/truth/carm.yaml"));
  const SimulatedDevice machine = simulatedMachine(nominal(), Eigen::Vector3d::Zero(), settings);
  EXPECT_EQ(truth.machine, "simulated-1");
  EXPECT_EQ(readViewSet(folder.path("set/camera/views.yaml")).views.size(), 3U);

  const ViewSet views = readViewSet(folder.path("set/geometry/views.yaml"));
  EXPECT_EQ(views.machine, "simulated-1");
  ASSERT_EQ(views.views.size(), 8U);
  double sum = 0;
  int beads = 0;
  for (const PhantomView& view : views.views) {
    const Pose T = truth.carm.T_camera_patient(*view.joints) * machine.T_patient_phantom;
    const XrayCamera camera = truth.carm.camera(*view.source_detector_distance_m);
    for (const BeadDetection& bead : readBeadTable(view.path)) {
      const auto& position_m = phantom.beads[static_cast<std::size_t>(*bead.bead)].position_m;
      sum += (machine.distortion->distorted(*camera.project(T * position_m)) - bead.center_px).squaredNorm();
      ++beads;
    }
  }
  // Two axes of noise; some 700 beads tell it to 3 %.
  EXPECT_NEAR(std::sqrt(sum / (2 * beads)), settings.bead_noise_px, 0.01);

  const PoseSet poses = readPoseSet(folder.path("set/hand-eye/poses.yaml"), &truth.carm);
  ASSERT_EQ(poses.poses.size(), 15U);
  for (const HandEyePose& pose : poses.poses) {
    const Pose off = (truth.carm.T_camera_patient(*pose.joints) * truth.T_dsa_cb).inverse() * pose.T_camera_object;
    EXPECT_LT(radToDeg(rotationAngle(off.linear())), 5 * settings.pose_noise_deg);
    EXPECT_LT(1e3 * off.translation().norm(), 5 * settings.pose_noise_mm);
  }
}

TEST(SimulatedCalibrationData, ImagesShowBeadsWhereTheTruthHasThem) {
  const test::TemporaryFolder folder;
  CalibrationSimulationSettings settings;
  settings.camera_views = settings.geometry_views = 1;
  settings.distortion = SimulatedDistortion::kIntensifier;
  writeCalibrationData(folder.path("set"), nominal(), Eigen::Vector3d::Zero(), settings, SimulatedImages::kCamera);
  const BeadPhantom phantom = readBeadPhantom(folder.path("set/phantom.yaml"));
  const SimulatedDevice machine = simulatedMachine(nominal(), Eigen::Vector3d::Zero(), settings);
  const SimulatedBeadView truth = simulatedCameraViews(machine, phantom, settings)[0];
  const auto found = detectBeads(readXrayImage(folder.path("set/camera/v0001.png")));
  int near = 0;
  for (Eigen::Index i = 0; i < truth.pixels_px.cols(); ++i) {
    const Eigen::Vector2d shown = machine.distortion->distorted(truth.pixels_px.col(i));
    near += std::any_of(found.begin(), found.end(),
                        [&](const BeadDetection& bead) { return (bead.center_px - shown).norm() < 0.5; });
  }
  EXPECT_GT(near, 0.8 * static_cast<double>(truth.pixels_px.cols())) << "of " << truth.pixels_px.cols();
}

TEST(SimulatedCalibrationData, AnotherNumberOfViewsIsTheSameMachine) {
  CalibrationSimulationSettings settings;
  const auto machine = simulatedMachine(nominal(), Eigen::Vector3d::Zero(), settings);
  settings.geometry_views = 3;
  const auto same = simulatedMachine(nominal(), Eigen::Vector3d::Zero(), settings);
  EXPECT_EQ(machine.truth.carm.poseParameters(), same.truth.carm.poseParameters());
  settings.seed = 2;
  const auto other = simulatedMachine(nominal(), Eigen::Vector3d::Zero(), settings);
  EXPECT_NE(machine.truth.carm.poseParameters(), other.truth.carm.poseParameters());
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include "angio/calibration_records/centered_carm.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

CArmFile crookedFile() {
  test::Random random(21);
  CArmFile file;
  auto values = file.carm.poseParameters();
  for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
    values[static_cast<Eigen::Index>(k)] += 3 * kCArmPoseParameterNames[k].unit * 0.01 * random.normal();
  }
  file.carm.setPoseParameters(values);
  file.carm.l_arm_rad = degToRad(12.5);
  CArmDeviations& d = file.carm.deviations;
  d.source_detector_offset_m = 2e-3;
  d.pixel_aspect = 1e-4;
  d.principal_point_px = {3, -4};
  d.principal_point_slope_px_per_m = {30, 20};
  d.flex = CArmFlex::lowOrder();
  for (auto& term : d.flex.terms) term.twist = random.twist(1e-4, 1e-4);
  file.machine = "lab-1";
  CalibrationRecord record;
  record.kind = "geometry";
  record.machine = "lab-1";
  record.date = "2026-01-31T12:00:00Z";
  record.parameters = {"axis_gap_mm"};
  record.values = Eigen::VectorXd::Constant(1, 2.5);
  record.covariance = Eigen::MatrixXd::Constant(1, 1, 0.01);
  record.residual_unit = "px";
  file.records.push_back(record);
  return file;
}

struct CArmFiles : testing::Test {
  test::TemporaryFolder folder;

  std::string refusal(const std::string& more) {
    const std::string path =
        folder.write("carm.yaml",
                     "source_isocentre_distance_mm: 810\nsource_detector_distance_mm: 1113\npixel_spacing_mm: 0.25\n"
                     "image_size_px: [1024, 1024]\n" +
                         more);
    return test::refusalOf([&] { readCArmFile(path); });
  }
};

TEST_F(CArmFiles, DeviationsComeBack) {
  const CArmFile file = crookedFile();
  writeCArmFile(folder.path("carm.yaml"), file);
  const CArmFile back = readCArmFile(folder.path("carm.yaml"));
  CArmJoints q;
  q << 0.7, -0.4, 0.02, -0.05, 0.03;
  // Degrees and millimetres there and back: the last digit of each.
  EXPECT_LT((back.carm.T_camera_patient(q).matrix() - file.carm.T_camera_patient(q).matrix()).cwiseAbs().maxCoeff(),
            1e-14);
  for (const double distance_m : {1.0, 1.2}) {
    const auto a = back.carm.camera(distance_m).parameters(), b = file.carm.camera(distance_m).parameters();
    EXPECT_NEAR(a.fx_px, b.fx_px, 1e-9);
    EXPECT_NEAR(a.fy_px, b.fy_px, 1e-9);
    EXPECT_NEAR(a.cx_px, b.cx_px, 1e-9);
    EXPECT_NEAR(a.cy_px, b.cy_px, 1e-9);
  }
  EXPECT_EQ(back.carm.deviations.flex.count, file.carm.deviations.flex.count);
  EXPECT_EQ(back.machine, "lab-1");
  ASSERT_EQ(back.records.size(), 1U);
  EXPECT_EQ(back.records[0].sigma("axis_gap_mm"), 0.1);
  EXPECT_FALSE(back.T_dsa_cb.has_value());
}

TEST_F(CArmFiles, ALoopIsToldWhatMakesTheMissingPose) {
  writeCArmFile(folder.path("carm.yaml"), crookedFile());
  const std::string said = test::refusalOf([&] { readCArmCalibration(folder.path("carm.yaml")); });
  EXPECT_THAT(said, HasSubstr("T_dsa_cb: is missing: angio-calibrate hand-eye"));
  EXPECT_THAT(said, HasSubstr("in a simulation --t-dsa-cb centre"));
}

TEST_F(CArmFiles, ATreeIsNotPlacedByTheCalibrationOfAnother) {
  const VesselTree tree = test::branchingTree(4), other = test::branchingTree(5);
  CArmFile file = crookedFile();
  file.T_dsa_cb = Pose::Identity();
  const std::string path = folder.path("carm.yaml");
  writeCArmFile(path, file);
  EXPECT_NO_THROW(readCArmCalibration(path, other));  // Nobody said of which it is.
  file.model_id = modelId(tree);
  writeCArmFile(path, file);
  EXPECT_EQ(readCArmCalibration(path, tree).model_id, modelId(tree));
  const std::string said = test::refusalOf([&] { readCArmCalibration(path, other); });
  EXPECT_THAT(said, HasSubstr("carm.yaml: model_id = "));
  EXPECT_THAT(said, HasSubstr("in a simulation give --t-dsa-cb centre"));
  EXPECT_EQ(readCenteredCArm(path, other.centroid()).model_id, ModelId::kUnknown);
  writeCArmCalibration(path, readCArmCalibration(path));
  EXPECT_EQ(readCArmFile(path).model_id, modelId(tree));
}

// What the file says of another tree does not count.
TEST_F(CArmFiles, ACenteredTreeHasItsCentroidAtTheIsocentre) {
  test::Random random(5);
  CArmFile file = crookedFile();
  const Eigen::Vector3d centroid = random.vector(0.1);
  for (const bool posed : {false, true}) {
    if (posed) {
      file.T_dsa_cb = expSE3(random.twist(0.5, 0.5));
      file.R_lps_model = expSO3(random.vector(1));
    }
    writeCArmFile(folder.path("carm.yaml"), file);
    const CArmCalibration read = readCenteredCArm(folder.path("carm.yaml"), centroid);
    EXPECT_EQ((read.T_dsa_cb * centroid).norm(), 0);
    EXPECT_TRUE(read.T_dsa_cb.linear().isIdentity(0));
    EXPECT_TRUE(read.R_lps_model.isIdentity(0));
    EXPECT_EQ(read.machine, "lab-1");
    EXPECT_EQ(read.records.size(), 1U);
    EXPECT_EQ(read.carm.l_arm_rad, readCArmFile(folder.path("carm.yaml")).carm.l_arm_rad);
  }
}

TEST_F(CArmFiles, BadDeviationsAreNamed) {
  EXPECT_THAT(refusal("deviations:\n  secondary_offset: 1\n"), HasSubstr("carm.yaml:6: secondary_offset = 1: unknown"));
  EXPECT_THAT(refusal("deviations:\n  secondary_offset_deg: 90\n"), HasSubstr("secondary_offset_deg = 90"));
  EXPECT_THAT(refusal("deviations:\n  table: [1, 0, 0, 0.01, 1, 0, 0, 0, 1]\n"), HasSubstr("deviations.table[3]"));
  EXPECT_THAT(refusal("l_arm_deg: 181\n"), HasSubstr("l_arm_deg = 181"));
  EXPECT_THAT(refusal("deviations:\n  flex:\n    - [0, 0, 0, 0, 0, 0, 1, 0]\n"), HasSubstr("flex[0]"));
  EXPECT_THAT(refusal("deviations:\n  flex:\n    - [99, 0, 0, 0, 0, 0, 1, 0, 0]\n"), HasSubstr("deviations.flex"));
}

}  // namespace
}  // namespace angio::test

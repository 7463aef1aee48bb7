// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

// A sound file, line by line, in which a test changes one line.
const std::vector<std::pair<std::string, std::string>> kLines = {
    {"source_isocentre_distance_mm", "source_isocentre_distance_mm: 810\n"},
    {"source_detector_distance_mm", "source_detector_distance_mm: 1113\n"},
    {"pixel_spacing_mm", "pixel_spacing_mm: 0.25\n"},
    {"image_size_px", "image_size_px: [1024, 512]\n"},
    {"T_dsa_cb", "T_dsa_cb:\n"},
    {"T_dsa_cb.rotation", "  rotation: [1, 0, 0, 0, 0, 1, 0, -1, 0]\n"},
    {"T_dsa_cb.translation_mm", "  translation_mm: [30, 12, -7]\n"},
    {"R_lps_model", "R_lps_model: [0, 1, 0, -1, 0, 0, 0, 0, 1]\n"}};

class CalibrationFiles : public testing::Test {
 protected:
  CArmCalibration readWith(const std::string& field, const std::string& line, const std::string& more = "") {
    std::string content;
    for (const auto& [name, text] : kLines) content += name == field ? line : text;
    return readCArmCalibration(folder_.write("carm.yaml", content + more));
  }
  void expectRefusal(const std::string& field, const std::string& line, const std::string& words) {
    const std::string said = test::refusalOf([&] { readWith(field, line); });
    EXPECT_NE(said.find("carm.yaml"), std::string::npos) << said;
    EXPECT_NE(said.find(words), std::string::npos) << field << ": " << said;
  }

  test::TemporaryFolder folder_;
};

TEST_F(CalibrationFiles, NumbersComeOutInMetres) {
  const CArmCalibration c = readWith("", "");
  EXPECT_DOUBLE_EQ(c.carm.source_isocenter_distance_m, 0.810);
  EXPECT_DOUBLE_EQ(c.carm.source_detector_distance_m, 1.113);
  EXPECT_DOUBLE_EQ(c.carm.pixel_spacing_m, 0.25e-3);
  EXPECT_EQ(c.carm.image_width_px, 1024);
  EXPECT_EQ(c.carm.image_height_px, 512);
  // Rows of the file are rows of the matrix: y of the patient is z of the model.
  EXPECT_TRUE((c.T_dsa_cb * Eigen::Vector3d(0.001, 0.002, 0.003)).isApprox(Eigen::Vector3d(0.031, 0.015, -0.009)));
  EXPECT_TRUE((c.R_lps_model * Eigen::Vector3d(1, 2, 3)).isApprox(Eigen::Vector3d(2, -1, 3)));
}

TEST_F(CalibrationFiles, TheBundledOneSeesTheTreeInTheMiddle) {
  const CArmCalibration c = readCArmCalibration(test::exampleData("hepatic-tace/carm.yaml"));
  // The centroid of tree.csv [mm], which the file puts at the isocentre; six digits are written.
  const Eigen::Vector3d centroid_mm = -1e3 * (c.T_dsa_cb.linear().transpose() * c.T_dsa_cb.translation());
  const Eigen::Vector3d seen = c.carm.T_camera_patient(CArmJoints::Zero()) * c.T_dsa_cb * (1e-3 * centroid_mm);
  EXPECT_TRUE(seen.isApprox(Eigen::Vector3d(0, 0, 0.810), 1e-9)) << seen.transpose();
  EXPECT_NEAR(c.carm.camera().parameters().fx_px, 1113 / 0.25355859375, 1e-9);
}

TEST_F(CalibrationFiles, EveryFieldButTheAnatomicalAxesIsRequired) {
  for (const auto& [name, text] : kLines) {
    if (name == "T_dsa_cb" || name == "R_lps_model") continue;
    expectRefusal(name, "", name + ": is missing");
  }
  EXPECT_TRUE(readWith("R_lps_model", "").R_lps_model.isIdentity(0));
  const std::string said = test::refusalOf([&] { readCArmCalibration(folder_.write("carm.yaml", "")); });
  EXPECT_NE(said.find("source_isocentre_distance_mm: is missing"), std::string::npos) << said;
}

TEST_F(CalibrationFiles, HostileValuesAreNamed) {
  expectRefusal("source_isocentre_distance_mm", "source_isocentre_distance_mm: 0\n",
                "source_isocentre_distance_mm = 0");
  expectRefusal("source_isocentre_distance_mm", "source_isocentre_distance_mm: .nan\n", "source_isocentre_distance_mm");
  expectRefusal("source_detector_distance_mm", "source_detector_distance_mm: -1113\n",
                "source_detector_distance_mm = -1113");
  expectRefusal("source_detector_distance_mm", "source_detector_distance_mm: 700\n",
                "must exceed source_isocentre_distance_mm");
  expectRefusal("pixel_spacing_mm", "pixel_spacing_mm: wide\n", "pixel_spacing_mm");
  expectRefusal("image_size_px", "image_size_px: [1024]\n", "image_size_px");
  expectRefusal("image_size_px", "image_size_px: [1024.5, 1024]\n", "image_size_px = 1024.5");
  expectRefusal("T_dsa_cb.rotation", "  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 0.9]\n", "T_dsa_cb.rotation");
  expectRefusal("T_dsa_cb.rotation", "  rotation: [1, 0, 0, 0, 1, 0, 0, 0, -1]\n", "T_dsa_cb.rotation");
  expectRefusal("T_dsa_cb.translation_mm", "  translation_mm: [0, 0, .inf]\n", "translation_mm");
  expectRefusal("R_lps_model", "R_lps_model: [0, 0, 0, 0, 0, 0, 0, 0, 0]\n", "R_lps_model");
  expectRefusal("R_lps_model", "R_lps_modell: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n", "R_lps_modell");
}

TEST(Calibration, ChecksWhatWasNotReadFromAFile) {
  CArmCalibration c;
  EXPECT_NO_THROW(c.check("mine"));
  c.T_dsa_cb.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(test::refusalOf([&] { c.check("mine"); }).find("mine: T_dsa_cb.translation_mm"), std::string::npos);
}

TEST(Miscalibrated, TurnsAboutTheCenterAndThenShifts) {
  test::Random random(4);
  for (int i = 0; i < 20; ++i) {
    CArmCalibration truth;
    truth.T_dsa_cb = expSE3(random.twist(0.1, 1));
    const Eigen::Vector3d center = random.vector(0.1), axis = random.vector(3), shift = random.vector(0.01);
    const double angle = random.uniform(0, 1);
    const CArmCalibration wrong = miscalibrated(truth, center, axis, angle, shift);
    const Eigen::Matrix3d turn = wrong.T_dsa_cb.linear() * truth.T_dsa_cb.linear().transpose();
    EXPECT_NEAR(rotationAngle(turn), angle, 1e-9);
    EXPECT_TRUE((turn * axis).isApprox(axis, 1e-9));
    EXPECT_TRUE((wrong.T_dsa_cb * center - truth.T_dsa_cb * center).isApprox(shift, 1e-9));
    EXPECT_EQ(wrong.carm.source_detector_distance_m, truth.carm.source_detector_distance_m);
  }
}

}  // namespace
}  // namespace angio::test

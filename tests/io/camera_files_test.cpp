// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/camera_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "angio/geometry/se3.hpp"
#include "angio/io/yaml.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

const XrayCamera kCamera({1024, 900, 4389.5, 4391.25, 520.125, 440.5, 0.25355859375e-3, 1.113});
const std::string kPlain = "image_size_px: [1024, 900]\nfx_px: 4389.5\nfy_px: 4391.25\ncx_px: 520\ncy_px: 440\n";

CameraFile writtenAndRead(const CameraFile& camera) {
  const test::TemporaryFolder folder;
  return readCameraFile(folder.write("camera.yaml", asYaml(cameraAsJson(camera)) + "calibration: {camera: {a: 1}}\n"));
}

TEST(CameraFiles, DistortionAndDistanceLawComeBack) {
  CameraFile file{kCamera, DetectorDistortion::radial(kCamera, 0.8, -3, 0.2), CameraDistanceLaw{-2.5e-3, {10, -20}}};
  for (const auto& distortion : {DetectorDistortion::radial(kCamera, 0.8, -3, 0.2),
                                 DetectorDistortion::intensifier(kCamera, {0.06, -0.01, degToRad(3), degToRad(-1)})}) {
    file.distortion = distortion;
    const CameraFile back = writtenAndRead(file);
    ASSERT_TRUE(back.distortion && back.distance_law);
    for (const Eigen::Vector2d& px : {Eigen::Vector2d(0, 0), Eigen::Vector2d(900, 300)}) {
      // Degrees in the file lose a bit of the last digit.
      EXPECT_LT((back.distortion->distorted(px) - distortion.distorted(px)).norm(), 1e-11);
    }
    EXPECT_NEAR(back.distance_law->offset_m, -2.5e-3, 1e-18);
    EXPECT_LT((back.distance_law->principal_point_slope_px_per_m - Eigen::Vector2d(10, -20)).norm(), 1e-13);
    EXPECT_EQ(back.camera.parameters().source_detector_distance_m, 1.113);
  }
  EXPECT_FALSE(writtenAndRead({kCamera, {}, {}}).distortion);
}

TEST(CameraFiles, APolynomialsCoefficientsComeBack) {
  DisplacementPolynomial shift{2, Eigen::Matrix2Xd(2, 6)};
  shift.coefficients_px << 1, 2, -3, 4, 5, 6, 0.5, -1, 7, 2, 1, -2;
  CameraFile file{kCamera, DetectorDistortion::polynomial({500, 450}, 640.5, shift), CameraDistanceLaw{1e-3, {0, 0}}};
  const CameraFile back = writtenAndRead(file);
  ASSERT_TRUE(back.distortion && back.distance_law);
  EXPECT_EQ(back.distortion->shift.coefficients_px, shift.coefficients_px);
  EXPECT_EQ(back.distortion->unit_px.x(), 640.5);
  const test::TemporaryFolder folder;
  const std::string path = folder.write(
      "c.yaml", kPlain +
                    "distortion: {model: polynomial, order: 1, centre_px: [1, 2], unit_px: 9, shift_x_px: [1, 2], "
                    "shift_y_px: [1, 2, 3]}\n");
  EXPECT_NE(test::refusalOf([&] { readCameraFile(path); }).find("shift_x_px"), std::string::npos);
}

TEST(CameraFiles, AnotherDistanceStretchesByTheTrueLengths) {
  const CameraFile file{kCamera, DetectorDistortion::radial(kCamera, 0.8, 0), CameraDistanceLaw{-13e-3, {10, -20}}};
  const CameraFile far = file.at(1.213);
  EXPECT_NEAR(far.camera.parameters().fx_px, 4389.5 * 1.2 / 1.1, 1e-9);
  EXPECT_NEAR(far.camera.parameters().cx_px, 521.125, 1e-9);
  EXPECT_NEAR(far.camera.parameters().cy_px, 438.5, 1e-9);
  EXPECT_EQ(far.distortion->unit_px.x(), far.camera.parameters().fx_px);
  EXPECT_NEAR(far.at(1.113).camera.parameters().fx_px, 4389.5, 1e-9);
  EXPECT_NE(test::refusalOf([] {
              CameraFile{kCamera, {}, {}}.at(1.2);
            }).find("source_detector_distance"),
            std::string::npos);
}

TEST(CameraFiles, OldFormsWithoutDistortionStillPass) {
  const test::TemporaryFolder folder;
  for (const char* form : {"0", "none", "[]", "[0, 0, 0, 0, 0]"}) {
    EXPECT_FALSE(readCameraFile(folder.write("c.yaml", kPlain + "distortion: " + form + "\n")).distortion) << form;
  }
}

TEST(CameraFiles, WrongDistortionIsRefusedAndPinholesHaveNone) {
  const test::TemporaryFolder folder;
  const auto refusal = [&](const std::string& lines) {
    const std::string path = folder.write("c.yaml", kPlain + lines);
    return test::refusalOf([&] { readCameraFile(path); });
  };
  EXPECT_NE(refusal("distortion: [0, 0.1]\n").find("c.yaml:6: distortion[1] = 0.1"), std::string::npos);
  EXPECT_NE(refusal("distortion: {model: fisheye}\n").find("must be one of radial, intensifier"), std::string::npos);
  EXPECT_NE(refusal("distortion: {model: radial, s1_deg: 3}\n").find("s1_deg"), std::string::npos);
  EXPECT_NE(refusal("distortion: {model: intensifier, k1: -2}\n").find("one-to-one"), std::string::npos);
  EXPECT_NE(refusal("source_detector_distance: {offset_mm: 1}\n").find("source_detector_distance_mm"),
            std::string::npos);
  const std::string path = folder.write("c.yaml", kPlain + "distortion: {model: radial, k1: 0.1}\n");
  EXPECT_NE(test::refusalOf([&] { readCamera(path); }).find("correct the distortion"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/mayacam_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/io/camera_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

MayaCam someCamera(double fy_px = 4500) {
  MayaCam c{XrayCamera({1024, 900, 4500, fy_px, 470.25, 610.5, {}, {}}), Pose::Identity()};
  c.T_camera_world.linear() = expSO3({0.4, -1.1, 0.3});
  c.T_camera_world.translation() = Eigen::Vector3d(0.12, -0.05, 0.9);
  return c;
}

TEST(MayaCam, BothFormatsComeBackAsTheyWere) {
  const test::TemporaryFolder folder;
  for (const char* name : {"camera.txt", "camera.csv"}) {
    const std::string path = folder.path(name);
    const MayaCam camera = someCamera();
    writeMayaCam(path, camera);
    const MayaCam back = readMayaCam(path);
    EXPECT_LT((back.T_camera_world.matrix() - camera.T_camera_world.matrix()).norm(), 1e-12) << name;
    EXPECT_NEAR(back.camera.parameters().cx_px, 470.25, 1e-9) << name;
    EXPECT_NEAR(back.camera.parameters().cy_px, 610.5, 1e-9) << name;
    EXPECT_EQ(back.camera.parameters().height_px, 900) << name;
    EXPECT_NEAR(readCamera(path).parameters().fx_px, 4500, 1e-9) << name;  // K alone, as a camera file.
  }
}

// By Autoscoper's definition of the first format: without turns the camera looks along -z, with x right and y up.
TEST(MayaCam, TheFirstFormatLooksAlongMinusZWithYUp) {
  const test::TemporaryFolder folder;
  const std::string path = folder.write("cam.csv", "0,0,100\n0,0,0\n1,2,-400\n513,513,-4000\n0.1,0,0\n");
  const MayaCam c = readMayaCam(path);
  const auto seen = [&](const Eigen::Vector3d& world_cm) {
    return Eigen::Vector2d(*c.camera.project(c.T_camera_world * (0.01 * world_cm)));
  };
  EXPECT_EQ(c.camera.width_px(), 1024);
  // u0 = 513 counts from 1, v0 = 513 from 1 and from below: 512 and 1023 - 512.
  EXPECT_LT((seen({0, 0, 0}) - Eigen::Vector2d(512, 511)).norm(), 1e-9);
  EXPECT_LT((seen({1, 0, 0}) - Eigen::Vector2d(552, 511)).norm(), 1e-9);  // 4000 px / 100.
  EXPECT_LT((seen({0, 1, 0}) - Eigen::Vector2d(512, 471)).norm(), 1e-9);
}

TEST(MayaCam, WrongFilesAreRefusedByLine) {
  const test::TemporaryFolder folder;
  const std::string good =
      "image size\n1024,1024\n\ncamera matrix\n4000,0,500\n0,4000,500\n0,0,1\n\nrotation\n1,0,0\n0,1,0\n0,0,1\n\n"
      "translation\n1\n2\n80\n";
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    const std::string path = folder.write("c.txt", text);
    return test::refusalOf([&] { readMayaCam(path); });
  };
  EXPECT_EQ(readMayaCam(folder.write("g.txt", good)).T_camera_world.translation().z(), 0.8);
  EXPECT_EQ(readMayaCam(folder.write("g.txt", good), 1e-3).T_camera_world.translation().z(), 0.08);
  EXPECT_NE(refusal("1,0,0\n0,1,0\n0,0,1\n\ntr", "1,0,0\n0,1,0\n0,0,-1\n\ntr").find("mirrored"), std::string::npos);
  EXPECT_NE(refusal("rotation", "turn").find("c.txt:9: heading = turn: must be \"rotation\""), std::string::npos);
  EXPECT_NE(refusal("0,4000,500", "0,x,500").find("c.txt:6: camera matrix = x"), std::string::npos);
  EXPECT_NE(refusal("4000,0,500", "4000,3,500").find("camera matrix"), std::string::npos);
  EXPECT_NE(refusal("2\n80\n", "2\n").find("translation"), std::string::npos);
  EXPECT_NE(refusal("80", "80000").find("unit of length"), std::string::npos);
  const std::string csv = folder.write("short.csv", "0,0,100\n0,0\n");
  EXPECT_NE(test::refusalOf([&] { readMayaCam(csv); }).find("short.csv:2: rotation angles"), std::string::npos);
  const auto path = folder.path("wide.csv");
  EXPECT_NE(test::refusalOf([&] { writeMayaCam(path, someCamera(4600)); }).find("write 2.0"), std::string::npos);
}

// XMALab's own files come back with all their digits.
TEST(MayaCam, XmalabsFilesAreRead) {
  NEED_SHARED_DATA("guide3d-calibration/xmalab_16709.txt");
  const test::TemporaryFolder folder;
  const MayaCam camera = readMayaCam(sharedData("guide3d-calibration/xmalab_16709.txt"));
  EXPECT_NEAR(camera.camera.parameters().fy_px, 4449.18817797, 1e-9);
  EXPECT_NEAR(camera.T_camera_world.translation().z(), 0.808628318359, 1e-12);
  writeMayaCam(folder.path("c.txt"), camera);
  EXPECT_LT((readMayaCam(folder.path("c.txt")).T_camera_world.matrix() - camera.T_camera_world.matrix()).norm(), 1e-14);
}

}  // namespace
}  // namespace angio::test

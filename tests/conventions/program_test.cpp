// SPDX-License-Identifier: GPL-2.0-or-later
// angio-inspect --convert-pose and --write-urdf.
#include <gmock/gmock.h>

#include "angio/conventions/rtk_geometry_file.hpp"
#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/program.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

struct ConvertPose : testing::Test {
  TemporaryFolder folder;
  const std::string pose = exampleData("hepatic-tace/nominal_pose.yaml");
  const std::string camera = exampleData("hepatic-tace/camera.yaml");
};

// Ours, to another program's file, and back to the files that angio-register reads.
TEST_F(ConvertPose, ThereAndBackThroughFiles) {
  for (const char* name : {"diffdrr", "xreg-detector", "rtk", "visp", "itk-versor"}) {
    const std::string theirs = folder.path("theirs.yaml");
    const auto there = run("angio-inspect", {pose, "--camera", camera, "--convert-pose", name, "--model-axes", "RAS",
                                             "--isocentre-mm", "1,-2,3", "--out", theirs});
    ASSERT_EQ(there.exit_code, 0) << name << ": " << there.err;
    const auto back = run("angio-inspect", {theirs, "--convert-pose", "angio", "--out", folder.path("pose.yaml"),
                                            "--write-camera", folder.path("camera.yaml")});
    ASSERT_EQ(back.exit_code, 0) << name << ": " << back.err;
    expectSame({readPose(folder.path("pose.yaml")).T_camera_model, readCamera(folder.path("camera.yaml"))},
               {readPose(pose).T_camera_model, readCamera(camera)});
  }
}

TEST_F(ConvertPose, AFlippedPictureIsSaid) {
  const auto there = run("angio-inspect", {pose, "--camera", camera, "--convert-pose", "xreg-negative-z"});
  ASSERT_EQ(there.exit_code, 0) << there.err;
  EXPECT_EQ(there.out.rfind("# Of the picture flipped left for right", 0), 0U);
  const std::string file = folder.write("xreg.yaml", there.out);
  const auto back = run("angio-inspect", {file, "--convert-pose", "visp"});
  EXPECT_THAT(back.err, HasSubstr("its picture has to be flipped left for right"));
}

TEST_F(ConvertPose, ARunsGeometryIsAFileOfRtk) {
  const std::string xml = folder.path("geometry.xml");
  const auto ended = run("angio-inspect", {exampleData("static-phantom/dicom/im5.dcm"), "--frame", "2",
                                           "--convert-pose", "rtk", "--out", xml});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const auto projections = readRtkGeometry(xml);
  ASSERT_EQ(projections.size(), 1U);
  EXPECT_NEAR(projections[0].source_to_isocenter_mm, 720, 1e-9);
  EXPECT_NEAR(projections[0].source_to_detector_mm, 931, 1e-9);
}

TEST_F(ConvertPose, WhatIsWrongGetsOneLineAndLeavesNothing) {
  const auto unknown = run("angio-inspect", {pose, "--camera", camera, "--convert-pose", "drr"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("convention = drr: must be one of angio, diffdrr"));
  const auto open = run("angio-inspect", {pose, "--convert-pose", "rtk", "--out", folder.path("a.xml")});
  EXPECT_EQ(open.exit_code, 1);
  EXPECT_THAT(open.err, HasSubstr("nominal_pose.yaml: camera: is not said by this file"));
  const auto ending =
      run("angio-inspect", {pose, "--camera", camera, "--convert-pose", "visp", "--out", folder.path("a.tfm")});
  EXPECT_EQ(ending.exit_code, 1);
  EXPECT_EQ(folder.files(), 0U);
}

TEST_F(ConvertPose, ACArmFileBecomesARobot) {
  const std::string urdf = folder.path("carm.urdf");
  const auto ended = run("angio-inspect", {exampleData("hepatic-tace/carm.yaml"), "--write-urdf", urdf});
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(contentOf(urdf), HasSubstr("<origin xyz=\"0 0 1.113\""));
  const auto wrong = run("angio-inspect", {camera, "--write-urdf", folder.path("b.urdf")});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, HasSubstr("source_isocentre_distance_mm"));
}

}  // namespace
}  // namespace angio::test

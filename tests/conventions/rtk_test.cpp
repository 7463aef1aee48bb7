// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/rtk.hpp"

#include <gmock/gmock.h>

#include "angio/conventions/rtk_geometry_file.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;
using testing::Not;

// The example of RTK's documentation, "3D projection geometry", section "XML File", with its cylindrical detector made
// flat.
const std::string kXml =
    "<?xml version=\"1.0\"?>\n<!DOCTYPE RTKGEOMETRY>\n<RTKThreeDCircularGeometry version=\"3\">\n"
    "  <SourceToIsocenterDistance>1000</SourceToIsocenterDistance>\n"
    "  <SourceToDetectorDistance>1536</SourceToDetectorDistance>\n"
    "  <Projection>\n"
    "    <GantryAngle>271.847274780273</GantryAngle>\n"
    "    <ProjectionOffsetX>-117.056503295898</ProjectionOffsetX>\n"
    "    <ProjectionOffsetY>-1.01195001602173</ProjectionOffsetY>\n"
    "    <Matrix>\n"
    "          -166.5093078829                   0   -1531.42837748039   -117056.503295898\n"
    "        -1.01142410874151               -1536  0.0326206557691505   -1011.95001602173\n"
    "       -0.999480303105996                   0  0.0322354417240802               -1000\n"
    "    </Matrix>\n"
    "  </Projection>\n"
    "  <Projection>\n"
    "    <GantryAngle>271.852905273438</GantryAngle>\n"
    "    <ProjectionOffsetX>-117.056831359863</ProjectionOffsetX>\n"
    "    <ProjectionOffsetY>-1.01187002658844</ProjectionOffsetY>\n"
    "    <Matrix>\n"
    "        -166.660129424325                   0   -1531.41199650136   -117056.831359863\n"
    "        -1.01134095059569               -1536  0.0327174625589984   -1011.87002658844\n"
    "       -0.999477130482326                   0  0.0323336611415466               -1000\n"
    "    </Matrix>\n"
    "  </Projection>\n"
    "</RTKThreeDCircularGeometry>\n";

RtkMatrix documentedMatrix() {
  RtkMatrix M;
  M << -166.5093078829, 0, -1531.42837748039, -117056.503295898, -1.01142410874151, -1536, 0.0326206557691505,
      -1011.95001602173, -0.999480303105996, 0, 0.0322354417240802, -1000;
  return M;
}

TEST(Rtk, TheDocumentedNumbersMakeTheDocumentedMatrixAndComeBackFromIt) {
  const TemporaryFolder folder;
  const auto projections = readRtkGeometry(folder.write("geometry.xml", kXml));
  ASSERT_EQ(projections.size(), 2U);
  // The documentation has 15 digits of entries up to 1e5.
  EXPECT_LT((rtkMatrix(projections[0]) - documentedMatrix()).cwiseAbs().maxCoeff(), 1e-9);
  for (const double scale : {1.0, -3.0}) {
    const RtkProjection back = rtkProjectionOf(scale * documentedMatrix());
    EXPECT_NEAR(back.gantry_deg, 271.847274780273, 1e-9);
    EXPECT_NEAR(std::remainder(back.out_of_plane_deg, 360), 0, 1e-9);
    EXPECT_NEAR(std::remainder(back.in_plane_deg, 360), 0, 1e-9);
    EXPECT_NEAR(back.source_to_isocenter_mm, 1000, 1e-9);
    EXPECT_NEAR(back.source_to_detector_mm, 1536, 1e-9);
    EXPECT_LT((back.projection_offset_mm - projections[0].projection_offset_mm).norm(), 1e-9);
    EXPECT_LT(back.source_offset_mm.norm(), 1e-9);
  }
}

// By hand, with all angles zero: the source is over the patient's front (z of the fixed system), the detector's x goes
// to the patient's left and its y to the head. A point 100 mm to the left of the isocentre is seen 100 * 1536 / 1000 =
// 153.6 mm along u. ITK's rows go up with v: the picture has to be flipped upside down.
TEST(Rtk, ZeroAnglesByHand) {
  RtkProjection p;
  p.source_to_isocenter_mm = 1000;
  p.source_to_detector_mm = 1536;
  RtkDetector d{512, 400, {-255.5, -199.5}, {1, 1}, {1, 1}};
  const ConvertedProjection seen = fromRtk(p, d, {});
  EXPECT_EQ(seen.flip, PictureFlip::kUpDown);
  // 100 mm to the left and 50 mm towards the head, in L, P, S.
  EXPECT_LT((pixelIn(seen, {100, 0, 50}) - Eigen::Vector2d(255.5 + 153.6, 199.5 + 76.8)).norm(), 1e-9);
  const auto up = seen.projection.camera.project(seen.projection.T_camera_model * Eigen::Vector3d(0.1, 0, 0.05));
  EXPECT_LT((*up - Eigen::Vector2d(255.5 + 153.6, 199.5 - 76.8)).norm(), 1e-9)
      << "the head is up as seen from the source";
}

// The matrix is RTK's own definition of where a point is seen.
TEST(Rtk, PointsAreSeenWhereTheMatrixHasThem) {
  Random random(9);
  for (const double u_direction : {1.0, -1.0}) {
    for (const double v_direction : {1.0, -1.0}) {
      RtkProjection p;
      p.source_to_isocenter_mm = 800;
      p.source_to_detector_mm = 1100;
      p.gantry_deg = random.uniform(0, 360);
      p.out_of_plane_deg = random.uniform(-60, 60);
      p.in_plane_deg = random.uniform(-180, 180);
      p.source_offset_mm = {3, -4};
      p.projection_offset_mm = {-20, 10};
      const RtkDetector d{512, 400, {-60, -50}, {0.4, 0.5}, {u_direction, v_direction}};
      WorldFrame world;
      world.model_axes = ModelAxes::kWorld;
      const ConvertedProjection seen = fromRtk(p, d, world);
      for (int k = 0; k < 5; ++k) {
        const Eigen::Vector3d p_world_mm = random.vector(30);
        const Eigen::Vector2d uv_mm = (rtkMatrix(p) * p_world_mm.homogeneous()).hnormalized();
        const Eigen::Vector2d index = (uv_mm - d.origin_mm).cwiseProduct(d.direction).cwiseQuotient(d.spacing_mm);
        EXPECT_LT((pixelIn(seen, p_world_mm) - index).norm(), 1e-9);
      }
    }
  }
}

TEST(Rtk, AGeometryFileComesBackWithWhatItsProjectionsShareOnce) {
  const TemporaryFolder folder;
  Random random(4);
  std::vector<RtkProjection> projections(5);
  for (RtkProjection& p : projections) {
    p.gantry_deg = random.uniform(0, 360);
    p.in_plane_deg = random.uniform(0, 360);
    p.source_to_isocenter_mm = 800;
    p.source_to_detector_mm = random.uniform(1000, 1200);
    p.source_offset_mm.y() = 0.1;
  }
  const std::string path = folder.path("geometry.xml");
  writeRtkGeometry(path, projections);
  const auto back = readRtkGeometry(path);
  ASSERT_EQ(back.size(), projections.size());
  for (std::size_t k = 0; k < back.size(); ++k) EXPECT_EQ(rtkMatrix(back[k]), rtkMatrix(projections[k]));
  const std::string text = contentOf(path);
  EXPECT_EQ(text.find("<SourceOffsetY>"), text.rfind("<SourceOffsetY>"));
  EXPECT_THAT(text, Not(HasSubstr("OutOfPlaneAngle")));
}

// More tags than a small XML document may have.
TEST(Rtk, AWholeScanIsRead) {
  const TemporaryFolder folder;
  std::vector<RtkProjection> projections(1440);
  for (std::size_t k = 0; k < projections.size(); ++k) {
    projections[k].gantry_deg = 0.25 * static_cast<double>(k);
    projections[k].source_to_isocenter_mm = 1000;
    projections[k].source_to_detector_mm = 1536;
  }
  writeRtkGeometry(folder.path("scan.xml"), projections);
  EXPECT_EQ(readRtkGeometry(folder.path("scan.xml")).size(), 1440U);
}

TEST(Rtk, WrongGeometryFilesAreRefusedInOneLine) {
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& what, const std::string& instead) {
    const std::string path = folder.write("bad.xml", with(kXml, what, instead));
    return refusalOf([&] { readRtkGeometry(path); });
  };
  EXPECT_THAT(refusal("version=\"3\"", "version=\"1\""), HasSubstr("version = 1: must be 2 or 3"));
  EXPECT_THAT(refusal("<GantryAngle>271.852905273438", "<GantryAngle>x"),
              HasSubstr("bad.xml: projection 1: GantryAngle = x"));
  EXPECT_THAT(refusal("-1531.42837748039", "-1531.4"), HasSubstr("projection 0: Matrix[2] = -1531.4: must be that"));
  EXPECT_THAT(refusal("<SourceToDetectorDistance>1536", "<SourceToDetectorDistance>0"),
              HasSubstr("SourceToDetectorDistance = 0: must be a positive number"));
  EXPECT_THAT(refusal("  <Projection>", "  <RadiusCylindricalDetector>1536</RadiusCylindricalDetector><Projection>"),
              HasSubstr("must be 0: a flat detector"));
  EXPECT_THAT(refusal("<!DOCTYPE RTKGEOMETRY>", "<!DOCTYPE RTKGEOMETRY [<!ENTITY a \"b\">]>"),
              HasSubstr("must not be used here"));
  EXPECT_THAT(refusal("<SourceToDetectorDistance>1536</SourceToDetectorDistance>",
                      "<SourceToDetecterDistance>1536</SourceToDetecterDistance>"),
              HasSubstr("SourceToDetecterDistance: must be one of GantryAngle"));
}

TEST(Rtk, MatricesThatAreNoProjectionAreRefused) {
  RtkMatrix sheared = documentedMatrix();
  sheared.row(0) += 0.1 * sheared.row(1);
  EXPECT_THAT(refusalOf([&] { rtkProjectionOf(sheared); }), HasSubstr("must not shear"));
  RtkMatrix flat = documentedMatrix();
  flat.row(2) << 0, 0, 0, 1;
  EXPECT_THAT(refusalOf([&] { rtkProjectionOf(flat); }), HasSubstr("singular"));
}

}  // namespace
}  // namespace angio::test

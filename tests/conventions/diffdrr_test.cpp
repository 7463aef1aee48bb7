// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/diffdrr.hpp"

#include "angio/conventions/euler_zxy.hpp"
#include "angio/test/errors.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

// The example in DiffDRR's README ("Hello, World!"): sdd=1020, height=200, delx=2.0, rotations 0, translations
// [0, 850, 0], orientation AP.
DiffDrrProjection readmeExample() {
  DiffDrrProjection p;
  p.translations_mm = {0, 850, 0};
  p.sdd_mm = 1020;
  p.height_px = p.width_px = 200;
  p.delx_mm = p.dely_mm = 2;
  return p;
}

// By hand: the source is 850 mm anterior of the isocentre. Seen from there with the head up, the patient's left is on
// the right: right, down and beam are L, -S and P.
TEST(DiffDrr, TheReadmesExampleByHand) {
  const ConvertedProjection seen = fromDiffDrr(readmeExample());
  XrayProjection expected{Pose::Identity(), XrayCamera::centered(200, 200, 2e-3, 1.020)};
  expected.T_camera_model.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  expected.T_camera_model.translation() = Eigen::Vector3d(0, 0, 0.850);
  expectSame(seen.projection, expected);
  EXPECT_EQ(seen.flip, PictureFlip::kNone);
}

// The same turned by 90 deg about z. By hand: R t = Rz (0, 850, 0) = (-850, 0, 0) in R, A, S, so the source is at the
// patient's left and the beam goes to the right; the picture's right is Rz (-1, 0, 0) = (0, -1, 0), posterior. x0 = 10
// and y0 = -4 mm move the detector: the principal point is 5 px further right (x counts to the left) and 2 px higher.
TEST(DiffDrr, ATurnedOneOffItsCentreByHand) {
  DiffDrrProjection p = readmeExample();
  p.rotations_deg = {90, 0, 0};
  p.x0_mm = 10;
  p.y0_mm = -4;
  p.world.isocenter_mm = {1, 2, 3};
  const XrayProjection seen = fromDiffDrr(p).projection;
  Eigen::Matrix3d R;
  R << 0, 1, 0, 0, 0, -1, -1, 0, 0;
  EXPECT_LT((seen.T_camera_model.linear() - R).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((seen.T_camera_model * Eigen::Vector3d(1e-3, 2e-3, 3e-3) - Eigen::Vector3d(0, 0, 0.85)).norm(), 1e-12);
  EXPECT_NEAR(seen.camera.parameters().cx_px, 99.5 + 5, 1e-9);
  EXPECT_NEAR(seen.camera.parameters().cy_px, 99.5 - 2, 1e-9);
}

// DiffDRR's own forward geometry (Detector._initialize_carm, calibration, reorient, RigidTransform), pixel by pixel.
TEST(DiffDrr, ItsDetectorsPixelsAreSeenWhereTheyAre) {
  Random random(3);
  for (const auto orientation : {DiffDrrOrientation::kAp, DiffDrrOrientation::kPa, DiffDrrOrientation::kNone}) {
    for (const bool reversed : {false, true}) {
      DiffDrrProjection p = readmeExample();
      p.width_px = 121;
      p.dely_mm = 1.5;
      p.x0_mm = 7;
      p.y0_mm = -5;
      p.orientation = orientation;
      p.reverse_x_axis = reversed;
      p.rotations_deg = random.vector(40);
      p.world.model_axes = ModelAxes::kRas;
      Eigen::Matrix3d reorient = Eigen::Matrix3d::Identity();
      if (orientation == DiffDrrOrientation::kAp) reorient << 1, 0, 0, 0, 0, -1, 0, 1, 0;
      if (orientation == DiffDrrOrientation::kPa) reorient << 1, 0, 0, 0, 0, 1, 0, 1, 0;
      const Eigen::Vector3d a = degToRad(1) * p.rotations_deg;
      const Eigen::Matrix3d R = rotationZxy({a[1], a[2], a[0]});
      const ConvertedProjection seen = fromDiffDrr(p);
      for (const int row : {0, 13, 199}) {
        for (const int column : {0, 77, 120}) {
          const double s = (reversed ? -1 : 1) * (column - 60.0), t = -(row - 99.5);
          const Eigen::Vector3d target_mm(s * p.delx_mm + p.x0_mm, t * p.dely_mm + p.y0_mm, p.sdd_mm);
          const Eigen::Vector3d p_world_mm = R * (reorient * target_mm + p.translations_mm);
          EXPECT_LT((pixelIn(seen, p_world_mm) - Eigen::Vector2d(column, row)).norm(), 1e-9);
        }
      }
    }
  }
}

TEST(DiffDrr, NeedsTheDistanceOfTheDetector) {
  XrayCamera::Parameters p{200, 200, 500, 500, 99.5, 99.5, {}, {}};
  const auto convert = [&] { toDiffDrr({Pose::Identity(), XrayCamera(p)}, DiffDrrOrientation::kAp, {}); };
  EXPECT_EQ(refusalOf(convert), "camera: source_detector_distance_mm: is missing, and DiffDRR needs it");
}

}  // namespace
}  // namespace angio::test

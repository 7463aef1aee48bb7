// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/xreg.hpp"

#include <gmock/gmock.h>

#include "angio/test/errors.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

// The camera that xreg makes of a Siemens CIOS Fusion (NaiveCamModelFromCIOSFusion, MakeNaiveIntrins with z_is_neg):
// 1536 x 1536 pixels of 0.194 mm, here 1020 mm from the source.
XregProjection fusion() {
  XregProjection p;
  p.num_rows = p.num_cols = 1536;
  p.row_spacing_mm = p.col_spacing_mm = 0.194;
  p.intrinsic << -1020 / 0.194, 0, 767.5, 0, -1020 / 0.194, 767.5, 0, 0, 1;
  return p;
}

// By hand: the point (97, 19.4, -510) mm is half way to the detector at z = -1020, where its shadow is at (194, 38.8)
// mm: 1000 px along the row and 200 px down from the middle. The picture is seen from the detector: as seen from the
// source it is 1000 px to the left.
TEST(Xreg, ACameraThatLooksAlongMinusZByHand) {
  const ConvertedProjection seen = fromXreg(fusion());
  EXPECT_EQ(seen.flip, PictureFlip::kLeftRight);
  EXPECT_LT((pixelIn(seen, {97, 19.4, -510}) - Eigen::Vector2d(1767.5, 967.5)).norm(), 1e-9);
  const Eigen::Vector3d p_camera = seen.projection.T_camera_model * Eigen::Vector3d(0.097, 0.0194, -0.510);
  EXPECT_LT((p_camera - Eigen::Vector3d(-0.097, 0.0194, 0.510)).norm(), 1e-12);
  EXPECT_NEAR(*seen.projection.camera.parameters().source_detector_distance_m, 1.020, 1e-12);
}

// xreg's own projection, CameraModel::phys_pt_to_ind_pt.
Eigen::Vector2d indexOf(const XregProjection& p, const Eigen::Vector3d& p_world_mm) {
  Eigen::Vector3d q = (p.extrinsic * p_world_mm.homogeneous()).head<3>();
  if (p.frame == XregFrame::kOnDetector) q.z() = 1020 - q.z();
  return (p.intrinsic * q).hnormalized();
}

TEST(Xreg, EveryFrameSeesPointsWhereXregDoes) {
  Random random(5);
  for (const auto frame : {XregFrame::kFocalPointPositiveZ, XregFrame::kFocalPointNegativeZ, XregFrame::kOnDetector}) {
    for (const double sign : {-1.0, 1.0}) {
      XregProjection p = fusion();
      p.frame = frame;
      p.intrinsic(0, 0) *= sign;
      p.intrinsic(0, 2) = 700;
      p.extrinsic.topLeftCorner<3, 3>() = expSO3(random.vector(1));
      const double z_mm = frame == XregFrame::kFocalPointPositiveZ ? 600 : frame == XregFrame::kOnDetector ? 400 : -600;
      p.extrinsic.topRightCorner<3, 1>() = Eigen::Vector3d(5, -7, z_mm);
      const ConvertedProjection seen = fromXreg(p);
      for (int k = 0; k < 5; ++k) {
        const Eigen::Vector3d p_world_mm = random.vector(20);
        EXPECT_LT((pixelIn(seen, p_world_mm) - indexOf(p, p_world_mm)).norm(), 1e-9);
      }
    }
  }
}

TEST(Xreg, RefusesWhatIsNoCameraOfOurs) {
  XregProjection sheared = fusion();
  sheared.intrinsic(0, 1) = 3;
  EXPECT_THAT(refusalOf([&] { fromXreg(sheared); }), HasSubstr("intrinsic[1] = 3: must be 0"));
  XregProjection scaled = fusion();
  scaled.extrinsic.topLeftCorner<3, 3>() *= 1.01;
  EXPECT_THAT(refusalOf([&] { fromXreg(scaled); }), HasSubstr("extrinsic"));
  XregProjection open = fusion();
  open.extrinsic(3, 3) = 2;
  EXPECT_THAT(refusalOf([&] { fromXreg(open); }), HasSubstr("must end in 0, 0, 0, 1"));
}

}  // namespace
}  // namespace angio::test

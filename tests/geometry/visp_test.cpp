// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/visp.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>
#include <visp3/core/vpMeterPixelConversion.h>
#include <visp3/core/vpPoint.h>

#include <limits>

#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

XrayCamera vispCamera() {
  XrayCamera::Parameters p;
  p.width_px = 960;
  p.height_px = 800;
  p.fx_px = 4400;
  p.fy_px = 4100;
  p.cx_px = 470.5;
  p.cy_px = 410.25;
  return XrayCamera(p);
}

TEST(Visp, PoseComesBack) {
  test::Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Pose T = expSE3(random.twist(1, 1));
    EXPECT_LT((fromVisp(toVisp(T)).matrix() - T.matrix()).cwiseAbs().maxCoeff(), 1e-14);
  }
}

TEST(Visp, PoseTakesPointsWhereVispTakesThem) {
  test::Random random(2);
  const Pose T = expSE3(random.twist(1, 1));
  const Eigen::Vector3d p = random.vector(1);
  vpPoint point(p.x(), p.y(), p.z());
  point.changeFrame(toVisp(T));
  EXPECT_LT((T * p - Eigen::Vector3d(point.get_X(), point.get_Y(), point.get_Z())).norm(), 1e-14);
}

TEST(Visp, RefusesWhatIsNoPose) {
  vpHomogeneousMatrix M;
  M[0][0] = 2;
  EXPECT_THAT(test::refusalOf([&] { (void)fromVisp(M); }), testing::HasSubstr("must be a rotation matrix"));
  M = vpHomogeneousMatrix();
  M[2][2] = -1;  // A mirror.
  EXPECT_THROW((void)fromVisp(M), InputError);
  M = vpHomogeneousMatrix();
  M[1][3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)fromVisp(M), InputError);
}

TEST(Visp, MatrixKeepsRowsAndColumns) {
  Eigen::Matrix<double, 2, 3> M;
  M << 1, 2, 3, 4, 5, 6;
  const vpMatrix v = toVisp(Eigen::MatrixXd(M));
  ASSERT_EQ(v.getRows(), 2u);
  ASSERT_EQ(v.getCols(), 3u);
  EXPECT_EQ(v[0][2], 3);
  EXPECT_EQ(v[1][0], 4);
}

TEST(Visp, ProjectsAsOurCameraDoes) {
  test::Random random(3);
  const auto parameters = toVisp(vispCamera());
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d p(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(0.4, 1));
    double u = 0, v = 0;
    vpMeterPixelConversion::convertPoint(parameters, p.x() / p.z(), p.y() / p.z(), u, v);
    EXPECT_LT((*vispCamera().project(p) - Eigen::Vector2d(u, v)).norm(), 1e-10);
  }
}

TEST(Visp, CameraComesBackWithItsSizeGiven) {
  const XrayCamera back = fromVisp(toVisp(vispCamera()), 960, 800);
  const Eigen::Vector3d p(0.02, -0.05, 0.8);
  EXPECT_EQ(*back.project(p), *vispCamera().project(p));
  EXPECT_EQ(back.width_px(), 960);
  EXPECT_EQ(back.height_px(), 800);
}

TEST(Visp, RefusesACameraWithDistortion) {
  vpCameraParameters parameters;
  parameters.initPersProjWithDistortion(4400, 4100, 470, 410, -0.1, 0.1);
  EXPECT_THAT(test::refusalOf([&] { (void)fromVisp(parameters, 960, 800); }), testing::HasSubstr("distortion"));
}

}  // namespace
}  // namespace angio::test

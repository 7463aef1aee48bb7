// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/xray_camera.hpp"
#include "angio/test/namespace.hpp"

#include <ceres/jet.h>
#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Nothing about it is symmetric, so that swapped axes or focal lengths show.
XrayCamera::Parameters skewedParameters() {
  XrayCamera::Parameters p;
  p.width_px = 960;
  p.height_px = 800;
  p.fx_px = 4400;
  p.fy_px = 4100;
  p.cx_px = 470.5;
  p.cy_px = 410.25;
  return p;
}

Eigen::Vector3d pointInView(test::Random& random) {
  return {random.uniform(-0.08, 0.08), random.uniform(-0.08, 0.08), random.uniform(0.4, 1.1)};
}

TEST(XrayCamera, AxesAreRightDownAndAwayFromTheSource) {
  const XrayCamera camera(skewedParameters());
  EXPECT_EQ(*camera.project({0, 0, 1}), Eigen::Vector2d(470.5, 410.25));
  // 10 mm right and 20 mm down at 1 m: fx and fy a metre.
  EXPECT_LT((*camera.project({0.01, 0.02, 1}) - Eigen::Vector2d(470.5 + 44, 410.25 + 82)).norm(), 1e-10);
}

TEST(XrayCamera, CenteredMagnifiesByDepthAndHasItsPrincipalPointAtTheDetectorsCenter) {
  const XrayCamera camera = XrayCamera::centered(1024, 768, 0.308e-3, 1.2);
  EXPECT_EQ(*camera.project({0, 0, 0.5}), Eigen::Vector2d(511.5, 383.5));
  // Half way to the detector everything is twice as large: 1 mm is 2 mm there.
  EXPECT_NEAR(camera.project({1e-3, 0, 0.6})->x() - 511.5, 2.0 / 0.308, 1e-10);
}

TEST(XrayCamera, APixelsRayComesBackToThePixel) {
  test::Random random(1);
  const XrayCamera camera(skewedParameters());
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d pixel(random.uniform(-100, 1100), random.uniform(-100, 900));
    const Eigen::Vector3d ray = camera.ray(pixel);
    EXPECT_EQ(ray.z(), 1);
    EXPECT_LT((*camera.project(random.uniform(0.1, 2) * ray) - pixel).norm(), 1e-9);
  }
}

TEST(XrayCamera, JacobianIsThatOfCentralDifferencesAndOfAutomaticDifferentiation) {
  using Jet = ceres::Jet<double, 3>;
  test::Random random(2);
  const auto parameters = skewedParameters();
  const XrayCamera camera(parameters);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p = pointInView(random);
    Eigen::Matrix<double, 2, 3> J;
    ASSERT_TRUE(camera.project(p, &J));
    const auto project = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd { return *camera.project(x.head<3>()); };
    // Entries reach 1e4 px/m. A step of 1e-5 m is off by h^2 f''' ~ 1e-10 * 1e5 and by 1e3 eps / h ~ 2e-8.
    EXPECT_LT((J - test::centralDifferences(project, p, 1e-5)).cwiseAbs().maxCoeff(), 1e-4);

    const Jet x(p.x(), 0), y(p.y(), 1), z(p.z(), 2);
    const Jet u = parameters.fx_px * x / z + parameters.cx_px, v = parameters.fy_px * y / z + parameters.cy_px;
    EXPECT_LT((J.row(0).transpose() - u.v).cwiseAbs().maxCoeff(), 1e-10);  // Rounding of numbers near 1e4.
    EXPECT_LT((J.row(1).transpose() - v.v).cwiseAbs().maxCoeff(), 1e-10);
  }
}

TEST(XrayCamera, NothingBehindTheSourceHasAnImage) {
  const XrayCamera camera(skewedParameters());
  for (const double z : {0.0, -0.0, -1e-9, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_FALSE(camera.project({0.01, 0.01, z})) << z;
  }
}

TEST(XrayCamera, SeesWholePixelsUpToTheBorder) {
  const XrayCamera camera(skewedParameters());
  EXPECT_TRUE(camera.sees({-0.5, -0.5}));
  EXPECT_TRUE(camera.sees({959.5, 799.5}));
  EXPECT_FALSE(camera.sees({-0.51, 10}));
  EXPECT_FALSE(camera.sees({10, 799.51}));
  EXPECT_FALSE(camera.sees({std::numeric_limits<double>::quiet_NaN(), 10}));
}

TEST(XrayCamera, NamesTheBadParameter) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const std::pair<const char*, std::function<void(XrayCamera::Parameters&)>> cases[] = {
      {"image_size_px[0] = 0", [](auto& p) { p.width_px = 0; }},
      {"image_size_px[1] = -4", [](auto& p) { p.height_px = -4; }},
      {"fx_px = -5", [](auto& p) { p.fx_px = -5; }},
      {"fy_px = nan", [&](auto& p) { p.fy_px = nan; }},
      {"cx_px = inf", [&](auto& p) { p.cx_px = inf; }},
      {"cy_px = nan", [&](auto& p) { p.cy_px = nan; }},
      {"pixel_spacing_mm = 0", [](auto& p) { p.pixel_spacing_m = 0; }},
      {"source_detector_distance_mm = -1000", [](auto& p) { p.source_detector_distance_m = -1; }},
  };
  for (const auto& [expected, spoil] : cases) {
    auto parameters = skewedParameters();
    spoil(parameters);
    EXPECT_THAT(test::refusalOf([&] { XrayCamera camera(parameters); }), testing::HasSubstr(expected));
  }
  EXPECT_THAT(test::refusalOf([] { XrayCamera::centered(8, 8, 0, 1); }), testing::HasSubstr("pixel_spacing_mm = 0"));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/frame_truth.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/phantoms.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

double sampled(const cv::Mat& image, const Eigen::Vector2d& p) {
  const int x = static_cast<int>(p.x()), y = static_cast<int>(p.y());
  const double u = p.x() - x, v = p.y() - y;
  const auto at = [&](int i, int j) { return static_cast<double>(image.at<std::uint16_t>(y + j, x + i)); };
  return (1 - v) * ((1 - u) * at(0, 0) + u * at(1, 0)) + v * ((1 - u) * at(0, 1) + u * at(1, 1));
}

TEST(FrameTruth, TheCentrelineIsTheRidgeOfTheImage) {
  FluoroscopySettings settings = test::withoutNoise(test::bare());
  settings.detector.psf_std_mm = 0.16;
  settings.detector.focal_spot_mm = 0.5;
  test::Random random(5);
  std::vector<double> offsets;
  for (int trial = 0; trial < 12; ++trial) {
    const Eigen::Vector3d a = 0.03 * random.direction(), b = a + 0.05 * random.direction();
    FluoroscopyRenderer renderer(test::segment(a, b, random.uniform(0.5e-3, 3e-3)), settings);
    const XrayScene scene = test::sceneAt(test::inView());
    const cv::Mat image = renderer.render(test::smallCamera(), scene, 0);
    const Centerline2d truth = renderer.truth(test::smallCamera(), scene).centerline;
    for (int i = 12; i < truth.size() - 12; ++i) {
      const Eigen::Vector2d normal(-std::sin(truth.tangent_rad[i]), std::cos(truth.tangent_rad[i]));
      const double reach = truth.radius_px[i] + 3;
      double mass = 0, moment = 0;
      bool outside = false;
      for (double s = -reach; s <= reach; s += 0.1) {
        const Eigen::Vector2d p = truth.points_px.col(i) + s * normal;
        outside |= p.minCoeff() < 1 || p.maxCoeff() > 509;
        if (outside) break;
        const double dark = settings.background_level - sampled(image, p);
        mass += dark;
        moment += dark * s;
      }
      if (!outside) offsets.push_back(moment / mass);
    }
  }
  ASSERT_GT(offsets.size(), 300U);
  double mean = 0;
  for (const double offset : offsets) {
    EXPECT_LT(std::abs(offset), 0.2);
    mean += offset / static_cast<double>(offsets.size());
  }
  EXPECT_LT(std::abs(mean), 0.02);
}

TEST(FrameTruth, RadiusAndContrastAreThoseOfTheVessel) {
  FluoroscopyRenderer renderer(test::straight(3e-3), test::bare());
  const Centerline2d truth = renderer.truth(test::smallCamera(), test::sceneAt(test::inView())).centerline;
  ASSERT_GT(truth.size(), 500);
  const int middle = truth.size() / 2;
  EXPECT_NEAR(truth.radius_px[middle], 1.5e-3 * test::smallCamera().parameters().fx_px / 0.75, 1e-6);
  EXPECT_NEAR(truth.contrast[middle], 0.07 * 3, 2e-3);
  EXPECT_EQ(truth.kind[middle], CurveKind::kVessel);
  EXPECT_EQ(truth.branch.back(), 0);
}

TEST(FrameTruth, ShowsOnlyWhatIsFilledOpenAndAboveTheNoise) {
  const VesselTree tree = test::branchingTree(2);
  FluoroscopySettings settings = test::bare();
  XrayScene scene = test::sceneAt(test::inView());
  const auto points = [&] {
    return FluoroscopyRenderer(tree, settings).truth(test::smallCamera(), scene).centerline.size();
  };
  const int all = points();
  scene.densities = Eigen::VectorXd::Zero(tree.size());
  EXPECT_EQ(points(), 0);
  scene.densities = Eigen::VectorXd::Ones(tree.size());
  scene.densities->tail(tree.size() / 2).setZero();
  EXPECT_LT(points(), 0.7 * all);
  EXPECT_GT(points(), 0.3 * all);
  scene.densities.reset();
  settings.photons_per_pixel = 4;
  EXPECT_LT(points(), 0.6 * all);
  settings.photons_per_pixel = 2500;

  settings.collimator.shutter = Shutter::kRectangle;
  settings.collimator.width = settings.collimator.height = 0.4;
  EXPECT_LT(points(), 0.7 * all);
  const Centerline2d open = FluoroscopyRenderer(tree, settings).truth(test::smallCamera(), scene).centerline;
  EXPECT_LE((open.points_px.array() - 255.5).abs().maxCoeff(), 0.2 * 512);
}

TEST(FrameTruth, KnowsDevicesFromVessels) {
  const VesselTree tree = test::branchingTree(2);
  XrayScene scene = test::sceneAt(test::inView());
  scene.devices = deviceInTree({DeviceKind::kGuidewire, 1, 1, 0, 60, 0}, tree.points(),
                               pathFromRoot(tree, endsByDistance(tree)[0]), 0.06);
  const Centerline2d truth = FluoroscopyRenderer(tree, {}).truth(test::smallCamera(), scene).centerline;
  const Centerline2d device = ofKind(truth, CurveKind::kDevice);
  ASSERT_GT(device.size(), 50);
  const Eigen::Vector3d tip = scene.devices[0].points.rightCols(1);
  EXPECT_LT((device.points_px.rightCols(1) - *test::smallCamera().project(test::inView() * tip)).norm(), 1e-9);
  EXPECT_GT(ofKind(truth, CurveKind::kVessel).size(), device.size());
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/device.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/base/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

TEST(Device, LiesInTheTreeAsFarAsItIsPushed) {
  const VesselTree tree = test::branchingTree(4);
  const std::vector<int> ends = endsByDistance(tree);
  const std::vector<int> path = pathFromRoot(tree, ends.front());
  EXPECT_EQ(path.front(), 0);
  EXPECT_EQ(path.back(), ends.front());
  for (std::size_t k = 1; k < path.size(); ++k) EXPECT_EQ(tree.parents()[path[k]], path[k - 1]);
  const auto lengthOf = [](const Eigen::Matrix3Xd& line) {
    double sum = 0;
    for (Eigen::Index k = 1; k < line.cols(); ++k) sum += (line.col(k) - line.col(k - 1)).norm();
    return sum;
  };
  EXPECT_NEAR(lengthOf(alongPath(tree.points(), path, 0.0535)), 0.0535, 1e-12);
  EXPECT_EQ(alongPath(tree.points(), path, 10).cols(), static_cast<Eigen::Index>(path.size()));
  EXPECT_THROW(pathFromRoot(tree, tree.size()), InputError);
  EXPECT_TRUE(deviceInTree({}, tree.points(), path, 0.05).empty());
}

TEST(Device, TakesTheBeamByItsMetalAndItsMarkerMore) {
  FluoroscopySettings settings = test::withoutNoise(test::noiseOnly());
  FluoroscopyRenderer renderer(test::straight(1e-3), settings);
  Device device;
  device.points.resize(3, 3);
  device.points << -0.2, 0, 0.04, 0, 0, 0, 0, 0, 0;
  device.diameter_m = 2e-3;
  device.attenuation_per_m = 150;
  device.marker_length_m = 0.05;
  device.marker_attenuation_per_m = 600;
  XrayScene scene = test::sceneAt(test::inView());
  scene.devices = {device};
  const cv::Mat image = renderer.render(test::smallCamera(), scene, 0);
  const auto taken = [&](double x_m) {
    const int x = static_cast<int>(std::lround(test::smallCamera().project({x_m, 0, 0.75})->x()));
    return -std::log(image.at<std::uint16_t>(255, x) / settings.background_level);
  };
  EXPECT_NEAR(taken(-0.03), 0.3, 3e-3);  // The pixel's ray passes the axis at a tenth of the radius.
  EXPECT_NEAR(taken(-0.005), 1.2, 12e-3);
  EXPECT_NEAR(taken(0.03), 1.2, 12e-3);
  EXPECT_NEAR(taken(0.05), 0, 1e-3);
}

}  // namespace
}  // namespace angio::test

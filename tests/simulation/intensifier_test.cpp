// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/intensifier.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/random.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

TEST(ImageIntensifier, TheInverseComesBack) {
  test::Random random(3);
  const DetectorDistortion intensifier = intensifierDistortion({0.06, -4}, 1024, 768);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d p(random.uniform(-200, 1224), random.uniform(-200, 968));
    EXPECT_LT((*intensifier.undistorted(intensifier.distorted(p)) - p).norm(), 1e-6);
    EXPECT_LT((intensifier.distorted(*intensifier.undistorted(p)) - p).norm(), 1e-6);
  }
  EXPECT_EQ(*intensifier.undistorted({511.5, 383.5}), Eigen::Vector2d(511.5, 383.5));
  const DetectorDistortion flat = intensifierDistortion({0, 0}, 1024, 768);
  EXPECT_LT((flat.distorted({17, 300}) - Eigen::Vector2d(17, 300)).norm(), 1e-9);
  // At the edge: out by 6 %, and by 4 degrees anticlockwise, up on the right.
  const Eigen::Vector2d edge = intensifier.distorted({1023.5, 383.5}) - Eigen::Vector2d(511.5, 383.5);
  EXPECT_NEAR(edge.norm(), 1.06 * 512, 1e-9);
  EXPECT_NEAR(std::atan2(edge.y(), edge.x()), degToRad(-4), 1e-12);
}

TEST(ImageIntensifier, BendsImageAndTruthAlike) {
  FluoroscopySettings settings = test::withoutNoise(test::bare());
  settings.intensifier = {0.08, 5};
  FluoroscopyRenderer renderer(test::segment({-0.1, 0.03, 0}, {0.1, 0.035, 0}, 1e-3), settings);
  const cv::Mat image = renderer.render(test::smallCamera(), test::inView(), 0);
  const Centerline2d truth = renderer.truth(test::smallCamera(), test::sceneAt(test::inView())).centerline;
  int compared = 0;
  for (int i = 0; i < truth.size(); ++i) {
    const Eigen::Vector2d p = truth.points_px.col(i);
    if (p.x() < 20 || p.x() > 490 || p.y() < 20 || p.y() > 490) continue;
    // The vessel runs across: the centre of what is dark in a window of its column.
    const int x = static_cast<int>(std::lround(p.x())), middle = static_cast<int>(std::lround(p.y()));
    double mass = 0, moment = 0;
    for (int y = middle - 8; y <= middle + 8; ++y) {
      const double dark = settings.background_level - image.at<std::uint16_t>(y, x);
      mass += dark;
      moment += dark * y;
    }
    const double slope = std::tan(truth.tangent_rad[i]);
    EXPECT_NEAR(moment / mass, p.y() + slope * (x - p.x()), 0.2) << p.transpose();
    ++compared;
  }
  EXPECT_GT(compared, 300);
}

}  // namespace
}  // namespace angio::test

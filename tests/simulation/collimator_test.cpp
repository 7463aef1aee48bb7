// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/collimator.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "scenes.hpp"

namespace angio::test {
namespace {

// Where the image falls through half of the open field's level, on the way from its centre through `to`.
double edgeFrom(const cv::Mat& image, const Eigen::Vector2d& center, const Eigen::Vector2d& to) {
  const Eigen::Vector2d step = (to - center).normalized();
  double last = 1;
  for (double s = 0;; s += 0.25) {
    const Eigen::Vector2d p = center + s * step;
    const int x = static_cast<int>(p.x()), y = static_cast<int>(p.y());
    if (x < 0 || y < 0 || x + 1 >= image.cols || y + 1 >= image.rows) return -1;
    const double u = p.x() - x, v = p.y() - y;
    const auto at = [&](int i, int j) { return static_cast<double>(image.at<std::uint16_t>(y + j, x + i)); };
    const double level =
        ((1 - v) * ((1 - u) * at(0, 0) + u * at(1, 0)) + v * ((1 - u) * at(0, 1) + u * at(1, 1))) / 20000;
    if (level < 0.5) return s - 0.25 * (0.5 - level) / (last - level);
    last = level;
  }
}

TEST(Collimator, TheImageEndsAtThePolygon) {
  FluoroscopySettings settings = test::withoutNoise(test::noiseOnly());
  settings.background_level = 20000;
  settings.collimator.width = 0.6;
  settings.collimator.height = 0.5;
  settings.collimator.center_x = 0.05;
  settings.collimator.turn_deg = 20;
  settings.collimator.leakage = 0;
  for (const Shutter shutter : {Shutter::kRectangle, Shutter::kOctagon, Shutter::kCircle}) {
    settings.collimator.shutter = shutter;
    FluoroscopyRenderer renderer(test::straight(1e-3), settings);
    const cv::Mat image = renderer.render(test::smallCamera(), test::inView(), 0);
    const auto corners = renderer.truth(test::smallCamera(), test::sceneAt(test::inView())).collimator_opening_px;
    const Eigen::Vector2d center(255.5 + 0.05 * 512, 255.5);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      // Away from corners, where softness rounds the edge off.
      const Eigen::Vector2d on_edge = 0.6 * corners[i] + 0.4 * corners[(i + 1) % corners.size()];
      EXPECT_NEAR(edgeFrom(image, center, on_edge), (on_edge - center).norm(), 0.25) << static_cast<int>(shutter);
    }
  }
}

TEST(Collimator, OpensToTheWholeDetector) {
  const auto corners = openField({}, 100, 50);
  ASSERT_EQ(corners.size(), 4U);
  EXPECT_EQ(corners[0], Eigen::Vector2d(-0.5, -0.5));
  EXPECT_EQ(corners[2], Eigen::Vector2d(99.5, 49.5));
  EXPECT_EQ(cv::countNonZero(shutterTransmission({}, 100, 50) != 1.0F), 0);
}

}  // namespace
}  // namespace angio::test

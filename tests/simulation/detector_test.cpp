// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/namespace.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

cv::Mat noise(const FluoroscopySettings& settings) {
  return FluoroscopyRenderer(test::straight(1e-3), settings).render(test::smallCamera(), test::inView(), 5);
}

// A Gaussian spread of standard deviation s leaves 1 / (4 pi s^2) of the variance, and correlates pixels d apart by
// exp(-d^2 / 4 s^2).
TEST(Detector, LightSpreadsQuantumNoiseAndNotTheElectronics) {
  FluoroscopySettings settings = test::noiseOnly();
  settings.electronic_noise_photons = 0;
  const double std_px = 1.5;
  settings.detector.psf_std_mm = std_px * 0.3;
  const double gain = settings.background_level / settings.photons_per_pixel;
  const cv::Mat spread = test::asDouble(noise(settings));
  cv::Scalar mean, deviation;
  cv::meanStdDev(spread, mean, deviation);
  // Of 2^18 pixels some 2^13 are independent: the variance is known to 1.6 %.
  EXPECT_NEAR(std::pow(deviation[0] / gain, 2) / settings.photons_per_pixel, 1 / (4 * kPi * std_px * std_px),
              0.06 / (4 * kPi * std_px * std_px));
  for (const int d : {1, 2, 3}) {
    const cv::Rect here(0, 0, 512 - d, 512);
    EXPECT_NEAR(test::correlation(spread(here), spread(here + cv::Point(d, 0))),
                std::exp(-d * d / (4 * std_px * std_px)), 0.04)
        << d;
  }

  settings.electronic_noise_photons = 100;
  const cv::Mat electronic = test::asDouble(noise(settings)) - spread;
  cv::meanStdDev(electronic, mean, deviation);
  EXPECT_NEAR(deviation[0] / gain, 100, 1.5);  // 0.14 % of statistics, rounding to whole grey values.
  const cv::Rect here(0, 0, 511, 512);
  EXPECT_NEAR(test::correlation(electronic(here), electronic(here + cv::Point(1, 0))), 0, 0.01);
}

TEST(Detector, BlurKeepsTheSumAndWidensAnEdge) {
  FluoroscopySettings settings = test::withoutNoise(test::bare());
  settings.collimator.shutter = Shutter::kRectangle;
  settings.collimator.width = 0.5;
  settings.collimator.edge_px = 0;
  settings.collimator.leakage = 0;
  settings.contrast_attenuation_per_mm = 0;
  settings.detector.psf_std_mm = 2 * 0.3;
  const cv::Mat image = noise(settings);
  // The edge is at 127.5: an error function of two pixels' width.
  for (const int x : {124, 126, 127, 128, 130}) {
    const double expected = settings.background_level * 0.5 * std::erfc(-(x - 127.5) / (2 * std::sqrt(2.0)));
    EXPECT_NEAR(image.at<std::uint16_t>(255, x), expected, 0.01 * settings.background_level) << x;
  }
}

TEST(Detector, EightBitsAreTheSameImageInFewerLevels) {
  FluoroscopySettings settings;
  const cv::Mat wide = noise(settings);
  settings.detector.bits = PixelDepth::k8;
  const cv::Mat narrow = noise(settings);
  ASSERT_EQ(narrow.type(), CV_8UC1);
  EXPECT_LE(cv::norm(test::asDouble(narrow) - test::asDouble(wide) / 257, cv::NORM_INF), 0.51);
}

TEST(Detector, AfterglowShowsTheFrameBefore) {
  FluoroscopySettings settings = test::withoutNoise(test::bare());
  settings.detector.lag = 0.25;
  FluoroscopyRenderer renderer(test::straight(4e-3), settings);
  const auto middle = [&](double density, std::uint64_t frame) {
    XrayScene scene = test::sceneAt(test::inView());
    scene.densities = Eigen::Vector2d::Constant(density);
    return static_cast<double>(renderer.render(test::smallCamera(), scene, frame).at<std::uint16_t>(255, 255));
  };
  const double full = middle(1, 0), after = middle(0, 1);
  EXPECT_NEAR(after, 0.75 * settings.background_level + 0.25 * full, 2);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/fluoroscopy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"
#include "angio/test/phantoms.hpp"

namespace angio {
namespace {

XrayCamera camera() { return XrayCamera::centred(512, 512, 0.3e-3, 1.1); }

Pose inView() {
  Pose T = Pose::Identity();
  T.translation() << 0, 0, 0.75;
  return T;
}

// One straight vessel across the image, its axis through the ray of pixel (255.5, 255.5).
VesselTree straight(double diameter_m) {
  Eigen::Matrix3Xd points(3, 2);
  points << -0.2, 0.2, 0, 0, 0, 0;
  return VesselTree(points, {-1, 0}, {0.5 * diameter_m, 0.5 * diameter_m});
}

FluoroscopySettings noiseOnly() {
  FluoroscopySettings settings;
  settings.contrast_attenuation_per_mm = 0;
  settings.background_strength = 0;
  return settings;
}

double correlation(const cv::Mat& a, const cv::Mat& b) {
  cv::Scalar mean_a, mean_b, std_a, std_b;
  cv::meanStdDev(a, mean_a, std_a);
  cv::meanStdDev(b, mean_b, std_b);
  return ((a.dot(b) / static_cast<double>(a.total())) - mean_a[0] * mean_b[0]) / (std_a[0] * std_b[0]);
}

cv::Mat asDouble(const cv::Mat& image) {
  cv::Mat result;
  image.convertTo(result, CV_64F);
  return result;
}

TEST(Fluoroscopy, AbsorbsAsMuchAsContrastInAnArteryDoes) {
  FluoroscopySettings settings;
  settings.background_strength = 0;
  settings.photons_per_pixel = 1e9;  // No noise to speak of.
  settings.electronic_noise_photons = 0;
  const auto absorbed = [&](double diameter_m) {
    const cv::Mat image = FluoroscopyRenderer(straight(diameter_m), settings).render(camera(), inView(), 0);
    return 1 - image.at<std::uint16_t>(255, 255) / settings.background_level;
  };
  // Beer-Lambert on the axis; the pixel's ray passes it at a sixteenth of a millimetre, and grey values are whole
  // numbers.
  EXPECT_NEAR(absorbed(4e-3), 1 - std::exp(-4 * settings.contrast_attenuation_per_mm), 1e-3);
  EXPECT_GT(absorbed(4e-3), 0.20);
  EXPECT_LT(absorbed(4e-3), 0.30);
  EXPECT_GT(absorbed(1e-3), 0.05);
  EXPECT_LT(absorbed(1e-3), 0.08);
}

TEST(Fluoroscopy, NoiseHasTheVarianceOfItsPhotons) {
  const FluoroscopySettings settings = noiseOnly();
  const cv::Mat image = FluoroscopyRenderer(straight(1e-3), settings).render(camera(), inView(), 3);
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  const double gain = settings.background_level / settings.photons_per_pixel;
  const double expected = settings.photons_per_pixel + std::pow(settings.electronic_noise_photons, 2);
  // Of 2^18 pixels: the mean is known to 0.003 %, the variance to 0.3 %; five times that.
  EXPECT_NEAR(mean[0], settings.background_level, 2e-4 * settings.background_level);
  EXPECT_NEAR(std::pow(deviation[0] / gain, 2), expected, 0.015 * expected);

  // Tails of a normal distribution: 0.27 % lie beyond three deviations, give or take 0.01 %.
  const cv::Mat far = cv::abs(asDouble(image) - mean[0]) > 3 * deviation[0];
  EXPECT_NEAR(cv::countNonZero(far) / static_cast<double>(far.total()), 0.0027, 0.0005);
}

TEST(Fluoroscopy, NoiseRepeatsNeitherOverFramesNorOverTheImage) {
  FluoroscopyRenderer renderer(straight(1e-3), noiseOnly());
  const cv::Mat first = asDouble(renderer.render(camera(), inView(), 0));
  const cv::Mat second = asDouble(renderer.render(camera(), inView(), 1));
  const double chance = 5 / 512.0;  // Five deviations of the correlation of 2^18 independent pairs.
  EXPECT_LT(std::abs(correlation(first, second)), chance);
  for (const cv::Point shift : {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(2, 0), cv::Point(64, 0)}) {
    const cv::Rect here(0, 0, 512 - shift.x, 512 - shift.y);
    EXPECT_LT(std::abs(correlation(first(here), first(here + shift))), 1.2 * chance) << shift;
    EXPECT_LT(std::abs(correlation(first(here), second(here + shift))), 1.2 * chance) << shift;
  }
}

TEST(Fluoroscopy, TheSameSeedAndFrameGiveTheSameImage) {
  const VesselTree tree = test::branchingTree(2);
  FluoroscopyRenderer one(tree, {}), other(tree, {});
  const cv::Mat image = one.render(camera(), inView(), 7);
  other.render(camera(), inView(), 1);  // What was rendered before leaves no trace.
  EXPECT_EQ(cv::norm(other.render(camera(), inView(), 7), image, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(other.render(camera(), inView(), 8), image, cv::NORM_INF), 0);
  FluoroscopySettings reseeded;
  reseeded.seed = 2;
  EXPECT_GT(cv::norm(FluoroscopyRenderer(tree, reseeded).render(camera(), inView(), 7), image, cv::NORM_INF), 0);
}

TEST(Fluoroscopy, UsesTheRangeOfGreyValuesWithoutSaturating) {
  const VesselTree tree = test::branchingTree(2);
  for (const int seed : {1, 2, 3, 4}) {
    FluoroscopySettings settings;
    settings.seed = seed;
    const cv::Mat image = FluoroscopyRenderer(tree, settings).render(test::clinicalCamera(), inView(), 0);
    EXPECT_NEAR(cv::mean(image)[0], settings.background_level, 0.2 * settings.background_level) << seed;
    const double saturated = cv::countNonZero(image == 65535) + cv::countNonZero(image == 0);
    EXPECT_LT(saturated / static_cast<double>(image.total()), 0.01) << seed;
    // Anatomy must be there, or an extractor is never tested against it.
    cv::Scalar mean, deviation;
    cv::meanStdDev(image, mean, deviation);
    EXPECT_GT(deviation[0] / mean[0], 0.5 * settings.background_strength) << seed;
  }
}

TEST(Fluoroscopy, WorksForADetectorOfAnySize) {
  const VesselTree tree = test::branchingTree(2);
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(9, 8), cv::Size(8, 17), cv::Size(333, 77)}) {
    const XrayCamera small = XrayCamera::centred(size.width, size.height, 0.3e-3, 1.1);
    EXPECT_EQ(FluoroscopyRenderer(tree, {}).render(small, inView(), 0).size(), size);
  }
}

TEST(Fluoroscopy, RefusesSettingsOutOfRangeByName) {
  FluoroscopySettings settings;
  settings.photons_per_pixel = std::nan("");
  try {
    FluoroscopyRenderer(straight(1e-3), settings);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("photons_per_pixel"));
  }
}

TEST(Fluoroscopy, RefusesAPoseThatIsNotFinite) {
  Pose T = inView();
  T.translation().z() = std::nan("");
  FluoroscopyRenderer renderer(straight(1e-3), {});
  EXPECT_THROW(renderer.render(camera(), T, 0), InputError);
  EXPECT_THROW(renderer.pathLength(camera(), T), InputError);
}

}  // namespace
}  // namespace angio

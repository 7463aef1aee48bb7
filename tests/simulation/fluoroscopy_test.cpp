// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "angio/base/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "scenes.hpp"

namespace angio::test {
namespace {

using test::asDouble;
using test::bare;
using test::correlation;
using test::inView;
using test::noiseOnly;
using test::straight;
using test::withoutNoise;

XrayCamera camera() { return test::smallCamera(); }

TEST(Fluoroscopy, AbsorbsAsMuchAsContrastInAnArteryDoes) {
  const FluoroscopySettings settings = withoutNoise(bare());
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

TEST(Fluoroscopy, AHardenedBeamIsTakenLessByMoreContrast) {
  FluoroscopySettings settings = withoutNoise(bare());
  const auto logAttenuation = [&](double diameter_m, double hardening) {
    settings.beam_hardening = hardening;
    const cv::Mat image = FluoroscopyRenderer(straight(diameter_m), settings).render(camera(), inView(), 0);
    return -std::log(image.at<std::uint16_t>(255, 255) / settings.background_level);
  };
  // Energies of 45, 55, 65 keV differ from the mean by 61, -7 and -41 %: a variance of 0.14, which takes half of it
  // times mu L from the attenuation of a thin layer.
  for (const double diameter_mm : {4.0, 10.0}) {
    const double thin = diameter_mm * settings.contrast_attenuation_per_mm;
    EXPECT_NEAR(logAttenuation(diameter_mm * 1e-3, 0), thin, 2e-3);
    EXPECT_NEAR(logAttenuation(diameter_mm * 1e-3, 1), thin * (1 - 0.5 * 0.14 * thin), 0.1 * 0.14 * thin * thin + 2e-3);
  }
}

TEST(Fluoroscopy, ScatterTakesItsShareOfTheContrast) {
  FluoroscopySettings settings = withoutNoise(bare());
  const auto absorbed = [&] {
    const cv::Mat image = FluoroscopyRenderer(straight(2e-3), settings).render(camera(), inView(), 0);
    return 1 - static_cast<double>(image.at<std::uint16_t>(255, 255)) / image.at<std::uint16_t>(20, 255);
  };
  const double without = absorbed();
  settings.detector.scatter_to_primary = 0.5;
  // The vessel itself takes a little of the scatter around it too.
  EXPECT_NEAR(absorbed(), without / 1.5, 0.01 * without);
}

TEST(Fluoroscopy, TheNumberOfThreadsDoesNotShow) {
  const VesselTree tree = test::branchingTree(2);
  FluoroscopySettings settings;
  settings.anatomy.contrast = 1;
  settings.collimator.shutter = Shutter::kOctagon;
  settings.intensifier.pincushion = 0.05;
  XrayScene scene = test::sceneAt(inView());
  scene.displacements_m = Eigen::Matrix3Xd::Constant(3, tree.size(), 1e-3);
  scene.densities = Eigen::VectorXd::LinSpaced(tree.size(), 1, 0);
  scene.devices = deviceInTree({DeviceKind::kCatheter, 1, 1, 0, 60, 0}, tree.points(), pathFromRoot(tree, 60), 0.03);
  const XrayCamera odd = XrayCamera::centered(501, 333, 0.3e-3, 1.1);
  const cv::Mat one = FluoroscopyRenderer(tree, settings).render(odd, scene, 3);
  for (const int threads : {2, 5}) {
    settings.threads = threads;
    EXPECT_EQ(cv::norm(FluoroscopyRenderer(tree, settings).render(odd, scene, 3), one, cv::NORM_INF), 0) << threads;
  }
}

TEST(Fluoroscopy, AnAirKermaIsANumberOfPhotons) {
  // IEC 62220-1, RQA5: 30174 quanta per mm^2 and uGy; 70 % of them count.
  EXPECT_NEAR(photonsPerPixel(1000, 1e-3), 0.7 * 30174, 1);
  FluoroscopySettings settings = noiseOnly();
  settings.electronic_noise_photons = 0;
  const auto relativeVariance = [&] {
    cv::Scalar mean, deviation;
    cv::meanStdDev(FluoroscopyRenderer(straight(1e-3), settings).render(camera(), inView(), 0), mean, deviation);
    return std::pow(deviation[0] / mean[0], 2);
  };
  settings.dose = Dose::kCine;
  // 2^18 pixels know a variance to 0.3 %.
  EXPECT_NEAR(relativeVariance() * photonsPerPixel(170, 0.3e-3), 1, 0.015);
}

TEST(Fluoroscopy, RefusesAScenePartThatDoesNotFit) {
  FluoroscopyRenderer renderer(straight(1e-3), {});
  XrayScene scene = test::sceneAt(inView());
  scene.displacements_m = Eigen::Matrix3Xd::Zero(3, 3);
  EXPECT_THROW(renderer.render(camera(), scene, 0), InputError);
  scene.displacements_m.reset();
  scene.densities = Eigen::Vector2d(1, std::nan(""));
  EXPECT_THROW(renderer.truth(camera(), scene), InputError);
  scene.densities.reset();
  scene.devices.push_back({});
  EXPECT_THROW(renderer.render(camera(), scene, 0), InputError);
}

TEST(Fluoroscopy, WorksForADetectorOfAnySize) {
  const VesselTree tree = test::branchingTree(2);
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(9, 8), cv::Size(8, 17), cv::Size(333, 77)}) {
    const XrayCamera small = XrayCamera::centered(size.width, size.height, 0.3e-3, 1.1);
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
}  // namespace angio::test

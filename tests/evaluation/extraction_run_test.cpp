// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/extraction_run.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "angio/evaluation/simulation_run.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

const VesselTree& liver() {
  static const VesselTree tree = readVesselTree(ANGIO_EXAMPLE_DATA "/hepatic-tace/tree.csv");
  return tree;
}

SimulationSettings fromImages(int trials) {
  SimulationSettings settings;
  settings.trials = trials;
  settings.from = TrialSource::kImages;
  settings.model_axes = ModelAxes::kLip;
  return settings;
}

TEST(ExtractionRun, EveryExtractorIsAskedOfEverySampleAndScored) {
  const ExtractionSamples samples = simulatedSamples({liver()}, {}, fromImages(2), SimulatedVessels{1, 6, false});
  const auto runs =
      runExtraction(samples, {{"ridge", RidgeSettings{}}, {"otsu", OtsuSettings{}}}, 1.5, Pictures::kKeep);
  ASSERT_EQ(runs.size(), 2u);
  for (const auto& run : runs) {
    EXPECT_EQ(run.times_s.size(), 2u);
    ASSERT_EQ(run.pictures.size(), 2u);
    EXPECT_EQ(run.pictures[1].image.size(), cv::Size(1024, 1024));
    // Far below what they reach, and far above chance.
    EXPECT_GT(run.score.asJson()["covered"], 0.5) << run.name;
    EXPECT_GT(run.score.asJson()["correct"], 0.5) << run.name;
    EXPECT_LT(run.score.asJson()["median_error_px"], 1) << run.name;
  }
  const std::string table = extractionTable(extractionSummaries(runs));
  EXPECT_THAT(table, testing::HasSubstr("| ridge | 2 |"));
}

// A share of nothing is no 0 %.
TEST(ExtractionRun, ImagesWithoutATruthAreNotScored) {
  const test::TemporaryFolder folder;
  cv::Mat image(200, 200, CV_8U, cv::Scalar(180));
  cv::line(image, {20, 30}, {180, 150}, cv::Scalar(100), 5, cv::LINE_AA);
  writeImage(folder.path("a.png"), image);
  const auto runs =
      runExtraction(imageSamples({folder.path("a.png")}), {{"ridge", RidgeSettings{}}}, 3, Pictures::kNone);
  const auto summaries = extractionSummaries(runs);
  EXPECT_FALSE(summaries["ridge"].contains("covered"));
  EXPECT_EQ(summaries["ridge"]["images_with_truth"], 0);
  EXPECT_NEAR(summaries["ridge"]["vessels_px"], 200, 20);  // The line's length; its ends are rounded.
  const std::string table = extractionTable(summaries);
  EXPECT_THAT(table, testing::HasSubstr("There is no truth to these images"));
  EXPECT_THAT(table, testing::Not(testing::HasSubstr("covered")));
}

TEST(SimulatedSamples, WantVesselsOfTheGivenWidthOutsideWiderOnes) {
  const auto all = simulatedSamples({liver()}, {}, fromImages(1), SimulatedVessels{0, 100, false}).at(0);
  const auto wide = simulatedSamples({liver()}, {}, fromImages(1), SimulatedVessels{3, 100, false}).at(0);
  EXPECT_GT(wide.required.size(), 50);
  EXPECT_LT(wide.required.size(), 0.7 * all.required.size());
  EXPECT_EQ(wide.allowed.points_px, all.allowed.points_px);
  EXPECT_LT(all.required.size(), all.allowed.size()) << "branches begin inside their trunk";
}

// Where the start of a trial has the tree; without the wish nothing is expected.
TEST(SimulatedSamples, MayBeExpected) {
  const ExtractionSample unknown = simulatedSamples({liver()}, {}, fromImages(1), SimulatedVessels{}).at(0);
  EXPECT_EQ(unknown.expected.size(), 0);
  SimulationSettings settings = fromImages(1);
  settings.translation_std_mm = 0.5;
  settings.rotation_std_deg = 0.3;
  const ExtractionSample known = simulatedSamples({liver()}, {}, settings, SimulatedVessels{1, 6, true}).at(0);
  EXPECT_EQ(known.allowed.points_px, unknown.allowed.points_px);
  ASSERT_GT(known.expected.size(), 100);
  ExtractionScore near(20), exact(0.1);
  near.add(known.expected, known.allowed);
  exact.add(known.expected, known.allowed);
  EXPECT_GT(near.asJson()["correct"], 0.95);
  EXPECT_LT(exact.asJson()["correct"], 0.7);
}

TEST(AnnotatedSamples, AreMasksOfTheImagesSize) {
  const test::TemporaryFolder folder;
  writeImage(folder.path("a.png"), cv::Mat(40, 60, CV_8U, cv::Scalar(90)));
  const std::vector<Eigen::Vector2d> square = {{10, 10}, {29, 10}, {29, 19}, {10, 19}};
  const auto sample = annotatedSamples({{folder.path("a.png"), 60, 40, {square}}}).at(0);
  EXPECT_EQ(cv::countNonZero(sample.mask), 200);
  EXPECT_THAT(test::refusalOf([&] {
                annotatedSamples({{folder.path("a.png"), 50, 40, {square}}}).at(0);
              }),
              testing::HasSubstr("must be that of the annotations"));
}

// The whole chain: rendered image, centreline, pose.
TEST(SimulationFromImages, FindsThePoseAndCountsTheTimeOfTheImage) {
  SimulationSetup setup;
  setup.trees = {liver()};
  setup.entrants = {{"oriented_kernel", OrientedKernelSettings{}, {}}};
  const auto runs = runSimulation(setup, fromImages(4));
  int right = 0;
  for (const auto& outcome : runs[0].outcomes) {
    EXPECT_GT(outcome.image_s, 0);
    right += outcome.error->mtre_m < kSuccessMtre_m;
  }
  EXPECT_GE(right, 3);  // An organ may hide what one view would need.
}

TEST(SimulationFromImages, RefusesNoiseThatImagesDoNotHave) {
  SimulationSettings settings = fromImages(1);
  settings.noise_px = 1;
  EXPECT_THAT(test::refusalOf([&] { TrialImages({liver()}, settings); }), testing::HasSubstr("noise_px"));
}

}  // namespace
}  // namespace angio::test

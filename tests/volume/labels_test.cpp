// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/labels.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/program.hpp"
#include "angio/test/random.hpp"
#include "angio/volume/coverage.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

VoxelGrid smallGrid() { return test::obliqueGrid({80, 80, 50}, {0.6e-3, 0.7e-3, 1.1e-3}); }

// Where the angiogram of the fork is bright: `vessels`, elsewhere 0.
Volume forkMask(float vessels) {
  Volume volume = test::tubes(test::bentFork(), smallGrid());
  for (float& value : volume.values) value = value > 500 ? vessels : 0;
  return volume;
}

// The fork (3) beside a slab (7).
Volume twoLabels() {
  Volume volume = forkMask(3);
  const std::size_t layer = 80 * 80;
  std::fill_n(volume.values.begin(), 4 * layer, 7.0F);
  return volume;
}

TEST(Labels, AreCountedWithTheirVolumes) {
  const std::vector<LabelSize> labels = labelsIn(twoLabels());
  ASSERT_EQ(labels.size(), 2U);
  EXPECT_EQ(labels[0].label, 3);
  EXPECT_EQ(labels[1].label, 7);
  EXPECT_EQ(labels[1].voxels, 4U * 80 * 80);
  EXPECT_NEAR(labels[1].volume_m3, 4 * 80 * 80 * 0.6e-3 * 0.7e-3 * 1.1e-3, 1e-15);
  EXPECT_THAT(listOfLabels(labels), AllOf(HasSubstr("3 ("), HasSubstr("7 (11.83 ml)")));
}

TEST(Labels, OfManyTheLargestAreListed) {
  std::vector<LabelSize> labels;
  for (int label = 1; label <= 50; ++label) labels.push_back({label, static_cast<std::size_t>(label), label * 1e-6});
  const std::string list = listOfLabels(labels);
  EXPECT_EQ(list.rfind("50 (50.00 ml), 49", 0), 0U) << list;
  EXPECT_THAT(list, AllOf(HasSubstr("21 (21.00 ml) and 20 smaller ones"), Not(HasSubstr(" 20 (20"))));
}

TEST(Labels, AMapOfThemIsToldFromAnImage) {
  EXPECT_TRUE(isLabelMap(twoLabels()));
  EXPECT_TRUE(isLabelMap(forkMask(1)));
  EXPECT_TRUE(isLabelMap(forkMask(255)));
  EXPECT_FALSE(isLabelMap(test::tubes(test::bentFork(), smallGrid()))) << "values at walls are not whole";
  EXPECT_FALSE(isLabelMap(forkMask(-1))) << "a level set or Hounsfield units";
  EXPECT_FALSE(isLabelMap(forkMask(0))) << "nothing is in it";
  Volume noisy = forkMask(60);
  test::Random random(3);
  for (float& value : noisy.values)
    value = std::max(0.0F, std::round(value + 20 + 5 * static_cast<float>(random.normal())));
  EXPECT_FALSE(isLabelMap(noisy)) << "an image of 8 bits";
  EXPECT_FALSE(isLabelMap(Volume{}));
}

TEST(Labels, AWrongOneIsRefusedWithThoseThatAreThere) {
  requireLabels("v.mha", twoLabels(), {7, 3, 0});
  const auto refusal = [](const Volume& volume, int label) {
    return test::refusalOf([&] { requireLabels("v.mha", volume, {label}); });
  };
  EXPECT_THAT(refusal(twoLabels(), 4), AllOf(HasSubstr("v.mha: --label = 4: "), HasSubstr("3 ("), HasSubstr("7 (")));
  EXPECT_THAT(refusal(forkMask(0), 1), HasSubstr("has no labels"));
}

TEST(ExtractTreeProgram, AsksForALabelAndListsThem) {
  const test::TemporaryFolder folder;
  const std::string map = folder.write("map.mha", test::metaImage(twoLabels())), out = folder.path("t.csv");
  for (const auto& options : {std::vector<std::string>{}, std::vector<std::string>{"--label", "4"}}) {
    std::vector<std::string> words{map, "--out", out};
    words.insert(words.end(), options.begin(), options.end());
    const test::Ended ended = test::run("angio-extract-tree", words);
    EXPECT_EQ(ended.exit_code, 1);
    EXPECT_THAT(ended.err, AllOf(HasSubstr("map.mha: --label"), HasSubstr("3 ("), HasSubstr("7 (11.83 ml)")));
    EXPECT_FALSE(std::filesystem::exists(out));
  }
  EXPECT_EQ(test::run("angio-extract-tree", {map, "--label", "3", "--out", out}).exit_code, 0);
  const VesselTree named = readVesselTree(out);

  // A mask has one only.
  const std::string mask = folder.write("mask.mha", test::metaImage(forkMask(255)));
  const test::Ended alone = test::run("angio-extract-tree", {mask, "--out", out});
  EXPECT_EQ(alone.exit_code, 0);
  EXPECT_THAT(alone.err, HasSubstr("is a mask: vessels are its label 255 ("));
  EXPECT_GT(coverage(readVesselTree(out), named, 2e-3).share, 0.9);
}

}  // namespace
}  // namespace angio::test

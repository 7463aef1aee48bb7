// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/shape.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"
#include "angio/volume/level_field.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

// Boxes along x of 6 x 3 x 3 voxels, at y = 2, 8 and 14, with values 1, 2 and 3.
Volume threeBoxes() {
  Volume volume;
  volume.grid.size = {12, 20, 8};
  volume.grid.spacing_m.setConstant(1e-3);
  volume.values.assign(volume.grid.count(), 0);
  for (int b = 0; b < 3; ++b) {
    for (int k = 0; k < 54; ++k) {
      volume.values[volume.grid.offset({2 + k % 6, 2 + 6 * b + k / 6 % 3, 2 + k / 18})] = static_cast<float>(b + 1);
    }
  }
  return volume;
}

long insideOf(const Volume& shape) {
  return std::count_if(shape.values.begin(), shape.values.end(), [](float value) { return value > 0; });
}

TEST(Shape, LabelsSeedsAndSizesChoose) {
  const Volume volume = threeBoxes();
  EXPECT_EQ(insideOf(vesselShape(volume, LabelSettings{}, {}, {})), 162);
  EXPECT_EQ(insideOf(vesselShape(volume, LabelSettings{{1, 3}}, {}, {})), 108);
  EXPECT_EQ(insideOf(vesselShape(volume, LabelSettings{}, {}, {{4e-3, 9e-3, 3e-3}})), 54);
  SelectionSettings one, large;
  one.max_pieces = 1;
  large.min_piece_mm3 = 55;
  EXPECT_EQ(insideOf(vesselShape(volume, LabelSettings{}, one, {})), 54);
  EXPECT_NE(test::refusalOf([&] { vesselShape(volume, LabelSettings{}, large, {}); }).find("nothing is left"),
            std::string::npos);
  EXPECT_NE(test::refusalOf([&] {
              vesselShape(volume, LabelSettings{}, {}, {{4e-3, 13e-3, 7e-3}});
            }).find("seed = 4,13,7: must lie in a vessel"),
            std::string::npos);
  EXPECT_NE(test::refusalOf([&] {
              vesselShape(volume, LabelSettings{}, {}, {{9, 9, 9}});
            }).find("seed"),
            std::string::npos);
}

TEST(Shape, SmallPiecesAreToldOf) {
  Volume volume = threeBoxes();
  EXPECT_TRUE(vesselShape(volume, LabelSettings{}, {}, {}).repairs.empty());
  for (const Eigen::Vector3i& v : {Eigen::Vector3i(11, 19, 7), {11, 19, 6}, {0, 19, 0}}) {
    volume.values[volume.grid.offset(v)] = 1;  // 2 mm3 and 1 mm3.
  }
  const VesselShape shape = vesselShape(volume, LabelSettings{}, {}, {});
  EXPECT_EQ(insideOf(shape), 162);
  ASSERT_EQ(shape.repairs.size(), 1U);
  EXPECT_EQ(shape.repairs.front().flaw, Flaw::kSmallPiece);
  EXPECT_EQ(shape.repairs.front().count, 2);
  EXPECT_LT((shape.repairs.front().at_m - volume.grid.pointAt({11, 19, 6.5})).norm(), 1e-9);
  EXPECT_NEAR(4 * kPi / 3 * std::pow(shape.repairs.front().radius_m, 3), 2e-9, 1e-12);
}

TEST(Shape, HolesAreFilledAndTheBorderIsAWall) {
  Volume volume = threeBoxes();
  volume.values[volume.grid.offset({4, 3, 3})] = 0;
  EXPECT_EQ(insideOf(vesselShape(volume, ThresholdSettings{0.5, Inside::kAbove}, {}, {})), 162);
  // A vessel that leaves the volume: below the threshold is nearly all of it.
  EXPECT_EQ(insideOf(vesselShape(volume, ThresholdSettings{0.5, Inside::kBelow}, {}, {})), 12 * 20 * 8 - 162 + 162);
}

TEST(Shape, ThicknessBetweenSlicesIsInterpolated) {
  VoxelMask mask;  // Squares of half width 2 and 6 in two slices that are 4 apart, within outside.
  mask.grid.size = {21, 21, 4};
  mask.grid.spacing_m = {1e-3, 1e-3, 4e-3};
  mask.inside.assign(mask.grid.count(), 0);
  for (int z = 1; z <= 2; ++z) {
    for (int y = 0; y < 21; ++y) {
      for (int x = 0; x < 21; ++x) {
        const int far = std::max(std::abs(x - 10), std::abs(y - 10));
        mask.inside[mask.grid.offset({x, y, z})] = far <= (z == 1 ? 2 : 6) ? 1 : 0;
      }
    }
  }
  const Volume fine = isotropic(signedDistance(mask), 1e-3);
  const LevelField level(fine);
  const double middle = level.wallDistance({10, 10, 6}, Eigen::Vector3d::UnitX(), 10);
  EXPECT_GT(middle, 3.5);  // Half-way between 2.5 and 6.5, not one of them.
  EXPECT_LT(middle, 5.5);
  EXPECT_NEAR(level.wallDistance({10, 10, 4}, Eigen::Vector3d::UnitX(), 10), 2.5, 1e-6);
}

TEST(Shape, VesselnessAnswersTubesOfItsSizesOnly) {
  Eigen::Matrix3Xd points(3, 2);
  points << -0.05, 0.05, 0, 0, 0, 0;
  const VesselTree tube(points, {-1, 0}, {2e-3, 2e-3});
  VoxelGrid grid;
  grid.size = {40, 40, 30};
  grid.spacing_m = {0.8e-3, 0.8e-3, 1e-3};
  grid.origin_m = {-16e-3, -16e-3, -15e-3};
  Volume volume = test::tubes(tube, grid);
  test::Random random(2);
  for (float& value : volume.values) value += static_cast<float>(20 * random.normal());
  for (int k = 0; k < 40 * 40; ++k) volume.values[grid.offset({k % 40, k / 40, 4})] += 1000;  // A bright sheet.
  const auto response = vesselness(volume, {});
  EXPECT_GT(response[grid.offset({20, 20, 15})], 0.9F);
  EXPECT_LT(response[grid.offset({20, 32, 15})], 0.1F);  // Background.
  EXPECT_LT(response[grid.offset({20, 32, 4})], 0.3F);   // The sheet.
  const Volume shape = vesselShape(volume, VesselnessSettings{}, {}, {});
  EXPECT_GT(LevelField(shape).at(shape.grid.indexAt({0, 0, 0})), 0);
}

}  // namespace
}  // namespace angio::test

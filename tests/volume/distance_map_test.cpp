// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/test/namespace.hpp"
#include "angio/volume/level_field.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/random.hpp"

namespace angio::test {
namespace {

TEST(DistanceMap, IsTheNearestVoxelOfAll) {
  test::Random random(5);
  VoxelMask mask;
  mask.grid.size = {11, 7, 9};
  mask.grid.spacing_m = {0.8, 1.1, 5};
  for (std::size_t i = 0; i < mask.grid.count(); ++i) mask.inside.push_back(random.uniform(0, 1) < 0.96 ? 1 : 0);
  const auto distances = distanceMap(mask, 0);
  const auto at = [&](std::size_t i) {
    return Eigen::Vector3d(static_cast<double>(i % 11), static_cast<double>(i / 11 % 7), static_cast<double>(i / 77));
  };
  for (std::size_t i = 0; i < distances.size(); ++i) {
    double nearest = 1e9;
    for (std::size_t j = 0; j < distances.size(); ++j) {
      if (mask.inside[j] == 0) nearest = std::min(nearest, (at(i) - at(j)).cwiseProduct(mask.grid.spacing_m).norm());
    }
    EXPECT_NEAR(distances[i], nearest, 1e-5 * nearest);  // Single precision.
  }
}

TEST(DistanceMap, IsInfiniteWhenThereIsNone) {
  VoxelMask mask;
  mask.grid.size = {2, 2, 2};
  mask.inside.assign(8, 1);
  for (const float distance : distanceMap(mask, 0)) EXPECT_TRUE(std::isinf(distance));
}

}  // namespace
}  // namespace angio::test

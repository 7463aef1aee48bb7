// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/extract_tree.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "angio/test/errors.hpp"
#include "angio/volume/coverage.hpp"
#include "angio/volume/shape.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

const Eigen::Vector3d kSpacing(0.6e-3, 0.7e-3, 1.1e-3);
constexpr double kHalfVoxel = 0.3e-3;  // Of the smallest spacing.

Volume forkVolume() { return test::tubes(test::bentFork(), test::obliqueGrid({90, 90, 60}, kSpacing)); }

ExtractedTree extracted(const Volume& volume, const CentrelineSettings& settings = {}) {
  return extractTree(vesselShape(volume, ThresholdSettings{500, Inside::kAbove}, {}, {}), settings);
}

// Distance of a point to the nearest fork of the phantom.
double fromFork(const VesselTree& truth, const Eigen::Vector3d& point) {
  return (truth.points().col(18) - point).norm();
}

TEST(ExtractTree, FindsTheCentrelineOfAnObliqueFork) {
  const VesselTree truth = test::bentFork();
  const ExtractedTree found = extracted(forkVolume());
  EXPECT_EQ(found.tree.branches().size(), 3U);
  EXPECT_EQ(std::count(found.tree.parents().begin(), found.tree.parents().end(), -1), 1);
  EXPECT_EQ(found.count(Flaw::kCycle), 0);
  // Where tubes join, the largest spheres leave the tubes' axes by as much as the wall between them is open.
  EXPECT_GT(coverage(truth, found.tree, kHalfVoxel).share, 0.9);
  EXPECT_LT(coverage(truth, found.tree, kHalfVoxel).worst_m, 4 * kHalfVoxel);
  for (int i = 0; i < found.tree.size(); ++i) {
    const Eigen::Vector3d point = found.tree.points().col(i);
    if (fromFork(truth, point) < 5e-3) continue;
    double nearest = 1;
    int nearest_true = 0;
    for (int j = 0; j < truth.size(); ++j) {
      const double distance = (truth.points().col(j) - point).norm();
      if (distance < nearest) nearest = distance, nearest_true = j;
    }
    // In the caps beyond the true ends there is no true radius; at most half a step lies between true points.
    if (nearest > 0.8e-3) continue;
    EXPECT_NEAR(*found.tree.radii()[static_cast<std::size_t>(i)],
                *truth.radii()[static_cast<std::size_t>(nearest_true)], kHalfVoxel)
        << i;
  }
}

TEST(ExtractTree, EndsReachTheWallOrTheLastSphere) {
  const VesselTree truth = test::bentFork();
  const auto endGap = [&](CentrelineEnd ends) {
    CentrelineSettings settings;
    settings.ends = ends;
    settings.spacing_mm = 0.25;
    const VesselTree tree = extracted(forkVolume(), settings).tree;
    double worst = 0;
    for (int i = 0; i < tree.size(); ++i) {
      const bool end =
          tree.parents()[static_cast<std::size_t>(i)] < 0 || tree.children()[static_cast<std::size_t>(i)].empty();
      if (!end) continue;
      const double depth = test::insideBy(truth, tree.points().col(i));
      const double wanted = ends == CentrelineEnd::kWall ? 0 : *tree.radii()[static_cast<std::size_t>(i)];
      worst = std::max(worst, std::abs(depth - wanted));
    }
    return worst;
  };
  EXPECT_LT(endGap(CentrelineEnd::kWall), kHalfVoxel);
  EXPECT_LT(endGap(CentrelineEnd::kSphere), 2 * kHalfVoxel);  // Steps of 0.25 mm, too.
}

TEST(ExtractTree, RootIsTheThickestEndOrTheOneAskedFor) {
  const VesselTree truth = test::bentFork();
  const Volume shape = vesselShape(forkVolume(), ThresholdSettings{500, Inside::kAbove}, {}, {});
  const auto rootOf = [](const VesselTree& tree) {
    const auto root = std::find(tree.parents().begin(), tree.parents().end(), -1) - tree.parents().begin();
    return Eigen::Vector3d(tree.points().col(root));
  };
  const Eigen::Vector3d branch_end = truth.points().rightCols<1>();
  EXPECT_GT((rootOf(extractTree(shape, {}).tree) - branch_end).norm(), 10e-3);  // An end of the trunk.
  EXPECT_LT((rootOf(extractTree(shape, {}, branch_end).tree) - branch_end).norm(), 2.5e-3);
}

TEST(ExtractTree, IsTheSameWhicheverWayTheVoxelsRun) {
  const Volume volume = forkVolume();
  Volume turned = volume;  // The same values in space, stored from the other ends of two axes.
  const Eigen::Vector3i size = volume.grid.size;
  turned.grid.direction.leftCols<2>() *= -1;
  turned.grid.origin_m = volume.grid.pointAt({size.x() - 1.0, size.y() - 1.0, 0});
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        turned.values[turned.grid.offset({size.x() - 1 - x, size.y() - 1 - y, z})] =
            volume.values[volume.grid.offset({x, y, z})];
      }
    }
  }
  const VesselTree a = extracted(volume).tree, b = extracted(turned).tree;
  // Thinning takes equal voxels in the order of memory: the skeletons differ by voxels, and so may the place where the
  // branch leaves; the centred lines hardly.
  for (const Coverage& c : {coverage(a, b, kHalfVoxel), coverage(b, a, kHalfVoxel)}) {
    EXPECT_GT(c.share, 0.95);
    EXPECT_LT(c.worst_m, 3 * kHalfVoxel);
  }
}

TEST(ExtractTree, CycleIsCutWhereItIsThinnest) {
  // A ring of 12 mm with a tail; the ring is thinnest opposite the tail's fork, at angle pi.
  Eigen::Matrix3Xd points(3, 75);
  std::vector<int> parents(75);
  std::vector<std::optional<double>> radii(75);
  for (int i = 0; i < 61; ++i) {
    const double angle = 2 * kPi * i / 60;
    points.col(i) = Eigen::Vector3d(12e-3 * std::cos(angle), 12e-3 * std::sin(angle), 0);
    parents[static_cast<std::size_t>(i)] = i - 1;
    radii[static_cast<std::size_t>(i)] = 2e-3 + 0.8e-3 * std::cos(angle);
  }
  for (int i = 61; i < 75; ++i) {
    points.col(i) = Eigen::Vector3d(12e-3 + 1e-3 * (i - 60), 0, 0);
    parents[static_cast<std::size_t>(i)] = i == 61 ? 0 : i - 1;
    radii[static_cast<std::size_t>(i)] = 2.8e-3;
  }
  VoxelGrid grid = test::obliqueGrid({110, 80, 60}, {0.6e-3, 0.6e-3, 0.8e-3});
  grid.direction.setIdentity();
  grid.origin_m = Eigen::Vector3d(-20e-3, -24e-3, -24e-3);
  const ExtractedTree found = extracted(test::tubes({points, parents, radii}, grid));
  EXPECT_EQ(found.count(Flaw::kCycle), 1);
  int ends = 0;
  for (int i = 0; i < found.tree.size(); ++i) {
    if (!found.tree.children()[static_cast<std::size_t>(i)].empty()) continue;
    ++ends;
    EXPECT_LT((found.tree.points().col(i) - Eigen::Vector3d(-12e-3, 0, 0)).norm(),
              6e-3);  // There the ring is within a sixth of a voxel of its thinnest.
  }
  EXPECT_EQ(ends, 2);
}

TEST(ExtractTree, ThickSlicesDoNotBreakVessels) {
  const VesselTree truth = test::bentFork();
  const Volume volume = test::tubes(truth, test::obliqueGrid({70, 70, 16}, {0.85e-3, 0.85e-3, 4e-3}));
  VoxelMask mask{volume.grid, {}};
  for (const float value : volume.values) mask.inside.push_back(value > 500 ? 1 : 0);
  const ExtractedTree found = extractTree(vesselShape(mask, {}, {}), {});
  EXPECT_EQ(std::count(found.tree.parents().begin(), found.tree.parents().end(), -1), 1);
  EXPECT_EQ(found.tree.branches().size(), 3U);
  EXPECT_GT(coverage(truth, found.tree, 2e-3).share, 0.95);  // Half a slice.
}

TEST(ExtractTree, RefusesWhatCannotBe) {
  const Volume shape = vesselShape(forkVolume(), ThresholdSettings{500, Inside::kAbove}, {}, {});
  CentrelineSettings long_trees, small_voxels, wrong;
  long_trees.min_tree_mm = 5000;
  small_voxels.voxel_mm = 0.01;
  wrong.spacing_mm = 0;
  EXPECT_NE(test::refusalOf([&] { extractTree(shape, long_trees); }).find("min_tree_mm = 5000: no tree"),
            std::string::npos);
  EXPECT_NE(test::refusalOf([&] { extractTree(shape, small_voxels); }).find("voxel_mm = 0.01"), std::string::npos);
  EXPECT_NE(test::refusalOf([&] { extractTree(shape, wrong); }).find("spacing_mm = 0"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

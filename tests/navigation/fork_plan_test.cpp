// SPDX-License-Identifier: GPL-2.0-or-later
#include "fork_plan.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace angio::test {
namespace {

// A vessel of 20 mm along z that goes on along z with a radius of `onward_radius_m`, and sends a branch of 1 mm to +x.
// Its line takes a step of 2 mm along y just before the fork where `stepped`, as thinned lines of voxels do.
VesselTree sideBranch(bool stepped, double onward_radius_m = 1.5e-3) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  const auto add = [&](int parent, const Eigen::Vector3d& p, double radius_m) {
    points.push_back(p);
    parents.push_back(parent);
    radii.emplace_back(radius_m);
    return static_cast<int>(points.size()) - 1;
  };
  int fork = -1;
  for (int k = 0; k <= 20; ++k) fork = add(fork, {0, 0, 1e-3 * k}, 1.5e-3);
  const double step_m = stepped ? 2e-3 : 0;
  if (stepped) fork = add(add(fork, {0, 1e-3, 20e-3}, 1.5e-3), {0, 2e-3, 20e-3}, 1.5e-3);
  for (const Eigen::Vector3d& along : {Eigen::Vector3d(0, 0, 1e-3), Eigen::Vector3d(1e-3, 0, 0)}) {
    int end = fork;
    for (int k = 1; k <= 20; ++k)
      end = add(end, Eigen::Vector3d(0, step_m, 20e-3) + k * along, along.z() > 0 ? onward_radius_m : 1e-3);
  }
  Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t k = 0; k < points.size(); ++k) matrix.col(static_cast<Eigen::Index>(k)) = points[k];
  return VesselTree(matrix, parents, radii);
}

// The branch that begins at the fork and ends further along `axis`.
int branchAlong(const TreeTopology& map, int axis) {
  for (int branch = 1; branch < map.branchCount(); ++branch) {
    if ((map.point({branch, 1}) - map.point({branch, 0}))[axis] > 5e-3) return branch;
  }
  return -1;
}

constexpr double kLever_m = 5.5e-3;

// The tip comes along z, whatever the last 2 mm of the line do: the branch is to the side of +x.
TEST(ForkPlan, AStepOfTheLineAtAForkDoesNotTurnTheSideOfABranch) {
  for (const bool stepped : {false, true}) {
    const TreeTopology map(sideBranch(stepped));
    const Fork fork = approachedFork(map, branchAlong(map, 0), branchAlong(map, 0), kLever_m);
    EXPECT_NEAR(fork.frame.normal.cross(fork.frame.binormal).dot(fork.frame.along), 1, 1e-9);
    EXPECT_GT(fork.frame.along.z(), std::cos(0.55));  // 2 mm to the side on 3.5 mm: 0.52 rad, not 1.57.
    const Eigen::Vector2d side = sideTowards(fork);
    const Eigen::Vector3d towards = side.x() * fork.frame.normal + side.y() * fork.frame.binormal;
    EXPECT_GT(towards.x(), 0.85) << stepped;  // By the last 2 mm alone 0.71.
  }
}

TEST(ForkPlan, StraightOnIsWhatTurnsLeastAndIsNotNarrow) {
  for (const bool stepped : {false, true}) {
    const TreeTopology map(sideBranch(stepped));
    EXPECT_TRUE(leadsStraightOn(map, branchAlong(map, 2), kLever_m)) << stepped;
    EXPECT_FALSE(leadsStraightOn(map, branchAlong(map, 0), kLever_m)) << stepped;
  }
  const TreeTopology narrow(sideBranch(false, 0.7e-3));
  EXPECT_FALSE(leadsStraightOn(narrow, branchAlong(narrow, 2), kLever_m));
}

}  // namespace
}  // namespace angio::test

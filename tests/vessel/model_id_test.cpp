// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/model_id.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// By FNV-1a's published parameters over the words (0, 0, 0, -1, 1'000'000, 0, 2'000'000'000, 0), lowest byte first,
// reckoned by another program.
TEST(ModelIds, AreTheSameOnEveryMachine) {
  Eigen::Matrix3Xd points(3, 2);
  points << 0, 1e-3, 0, 0, 0, 2;
  EXPECT_EQ(static_cast<std::int64_t>(modelId(VesselTree(points, {-1, 0}))), 40503278547966660LL);
}

TEST(ModelIds, TellTreesApart) {
  const VesselTree tree = test::branchingTree(3);
  const auto with = [&](Eigen::Matrix3Xd points, std::vector<int> parents,
                        std::vector<std::optional<double>> radii = {}) {
    return modelId(VesselTree(std::move(points), std::move(parents), std::move(radii)));
  };
  EXPECT_EQ(with(tree.points(), tree.parents()), modelId(tree)) << "radii do not count";
  EXPECT_EQ(with(tree.points() * (1 + 1e-13), tree.parents()), modelId(tree)) << "nor does rounding";
  EXPECT_NE(with(tree.points() * 1.0001, tree.parents()), modelId(tree));
  EXPECT_NE(with(tree.points().rowwise().reverse(), tree.parents()), modelId(tree));
  std::vector<int> parents = tree.parents();
  parents.back() = parents[static_cast<std::size_t>(parents.back())];
  EXPECT_NE(with(tree.points(), parents), modelId(tree));
}

}  // namespace
}  // namespace angio::test

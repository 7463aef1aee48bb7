// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/resample.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr int kNoLimit = 1000000;

double longestEdge(const VesselTree& tree) {
  double longest = 0;
  for (int i = 0; i < tree.size(); ++i) {
    if (tree.parents()[i] >= 0) {
      longest = std::max(longest, (tree.points().col(i) - tree.points().col(tree.parents()[i])).norm());
    }
  }
  return longest;
}

Eigen::Vector3d pointAt(const ResampledTree& r, const ResampledTree::Place& place) {
  return (1 - place.weight) * r.tree.points().col(place.a) + place.weight * r.tree.points().col(place.b);
}

struct Subdividing : testing::TestWithParam<double> {};

TEST_P(Subdividing, KeepsEveryPointAndTheLengthAndNoEdgeIsLongerThanAsked) {
  const VesselTree tree = test::branchingTree(1);
  const ResampledTree r = resampled(tree, GetParam(), kNoLimit);
  EXPECT_LE(longestEdge(r.tree), GetParam() * (1 + 1e-6));
  EXPECT_NEAR(r.tree.length(), tree.length(), 1e-12);  // New points lie on the edges, but for rounding.
  ASSERT_EQ(r.place_of_original.size(), static_cast<std::size_t>(tree.size()));
  for (int i = 0; i < tree.size(); ++i) {
    EXPECT_LT((pointAt(r, r.place_of_original[i]) - tree.points().col(i)).norm(), 1e-15);
  }
}

// Below, between and above the 1 mm edges of the phantom, and where the number of pieces is a rounding away from
// another.
INSTANTIATE_TEST_SUITE_P(Spacing, Subdividing, testing::Values(0.3e-3, 0.5e-3, 0.7e-3, 1e-3, 5e-3));

TEST(Resampled, WithoutSpacingThePointsAreTheSame) {
  const VesselTree tree = test::branchingTree(2);
  const ResampledTree r = resampled(tree, 0, kNoLimit);
  EXPECT_EQ(r.tree.size(), tree.size());
  for (int i = 0; i < tree.size(); ++i) EXPECT_EQ(pointAt(r, r.place_of_original[i]), tree.points().col(i));
}

TEST(Resampled, EachPointComesAfterItsParentAndBranchesMeetAsBefore) {
  const VesselTree tree = test::branchingTree(2);
  const ResampledTree r = resampled(tree, 0.4e-3, kNoLimit);
  for (int i = 0; i < r.tree.size(); ++i) EXPECT_LT(r.tree.parents()[i], i);
  EXPECT_EQ(r.tree.branches().size(), tree.branches().size());
}

TEST(Resampled, ThinsToTheLimitAndKeepsEndsAndBifurcations) {
  const VesselTree tree = test::branchingTree(3);
  const int limit = 300;
  const ResampledTree r = resampled(tree, 0.5e-3, limit);
  const int branches = static_cast<int>(tree.branches().size());
  // Each branch rounds its number of steps to the nearest, and a root is one point more.
  EXPECT_LE(r.tree.size(), limit + (branches + 1) / 2 + 1);
  EXPECT_GE(r.tree.size(), limit - branches / 2);
  EXPECT_EQ(r.tree.branches().size(), tree.branches().size());
  for (const auto& branch : tree.branches()) {
    for (const int end : {branch.front(), branch.back()}) {
      EXPECT_LT((pointAt(r, r.place_of_original[end]) - tree.points().col(end)).norm(), 1e-15);
    }
  }
  // Chords are shorter than the curve they cut; steps of 3 mm on this phantom's bends cost two per cent.
  EXPECT_LE(r.tree.length(), tree.length());
  EXPECT_GT(r.tree.length(), 0.98 * tree.length());
}

TEST(Resampled, ThinnedOriginalsLieWithinHalfAStepOfTheirPlace) {
  const VesselTree tree = test::branchingTree(3);
  const int limit = 300;
  const ResampledTree r = resampled(tree, 0.5e-3, limit);
  const double step = tree.length() / limit;
  for (int i = 0; i < tree.size(); ++i) {
    const auto& place = r.place_of_original[i];
    EXPECT_GE(place.weight, 0);
    EXPECT_LE(place.weight, 1);
    EXPECT_TRUE(place.a == place.b || r.tree.parents()[place.b] == place.a);
    EXPECT_LT((pointAt(r, place) - tree.points().col(i)).norm(), step / 2);
  }
}

TEST(Resampled, InterpolatesRadiiWhereBothEndsAreKnown) {
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, 3);
  points.row(0) << 0, 0.004, 0.008;
  const ResampledTree r = resampled(VesselTree(points, {-1, 0, 1}, {2e-3, 1e-3, std::nullopt}), 1e-3, kNoLimit);
  ASSERT_EQ(r.tree.size(), 9);
  EXPECT_NEAR(*r.tree.radii()[1], 1.75e-3, 1e-15);
  EXPECT_NEAR(*r.tree.radii()[4], 1e-3, 1e-15);
  EXPECT_FALSE(r.tree.radii()[8].has_value()) << "what is unknown stays unknown";
}

}  // namespace
}  // namespace angio::test

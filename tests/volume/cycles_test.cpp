// SPDX-License-Identifier: GPL-2.0-or-later
// Tubes whose skeleton is no tree, or has more branches than vessels: what is cut, where, and what is said of it.
#include <gtest/gtest.h>

#include <algorithm>

#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/volume/coverage.hpp"
#include "angio/volume/extract_tree.hpp"
#include "angio/volume/shape.hpp"
#include "phantom.hpp"

namespace angio::test {
namespace {

constexpr double kVoxelOfTubes = 0.5e-3;

// Lines of points [mm], each a vessel of its radius [mm].
struct Vessel {
  std::vector<Eigen::Vector3d> points_mm;
  double radius_mm;
};

std::vector<Eigen::Vector3d> line(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& to_mm) {
  std::vector<Eigen::Vector3d> points_mm;
  for (int i = 0; i <= 20; ++i) points_mm.push_back(from_mm + i / 20.0 * (to_mm - from_mm));
  return points_mm;
}

// Arcs about (x, y) = middle; z rises by `rise_mm` over the arc.
std::vector<Eigen::Vector3d> arc(const Eigen::Vector2d& middle_mm, double radius_mm, double from, double to,
                                 double rise_mm) {
  std::vector<Eigen::Vector3d> points_mm;
  for (int i = 0; i <= 120; ++i) {
    const double angle = from + i / 120.0 * (to - from);
    points_mm.emplace_back(middle_mm.x() + radius_mm * std::cos(angle), middle_mm.y() + radius_mm * std::sin(angle),
                           rise_mm * i / 120);
  }
  return points_mm;
}

VesselTree treeOf(const std::vector<Vessel>& vessels) {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  for (const Vessel& vessel : vessels) {
    for (std::size_t i = 0; i < vessel.points_mm.size(); ++i) {
      parents.push_back(i == 0 ? -1 : static_cast<int>(points.size()) - 1);
      points.emplace_back(vessel.points_mm[i] / 1e3);
      radii.emplace_back(vessel.radius_mm / 1e3);
    }
  }
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return {matrix, parents, radii};
}

// A mask, as a segmentation is: a voxel is in or out.
Volume segmented(const VesselTree& truth) {
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(5e-3);
  VoxelMask mask;
  mask.grid.spacing_m.setConstant(kVoxelOfTubes);
  mask.grid.origin_m = truth.points().rowwise().minCoeff() - margin;
  const Eigen::Vector3d size = truth.points().rowwise().maxCoeff() + margin - mask.grid.origin_m;
  mask.grid.size = (size / kVoxelOfTubes).array().ceil().cast<int>();
  mask.inside.resize(mask.grid.count());
  forEachVoxel(mask.grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    mask.inside[at] = insideBy(truth, mask.grid.pointAt(v.cast<double>())) >= 0 ? 1 : 0;
  });
  return vesselShape(mask, {}, {});
}

int roots(const VesselTree& tree) {
  return static_cast<int>(std::count(tree.parents().begin(), tree.parents().end(), -1));
}

double apart_mm(const Repair& repair, double x, double y, double z) {
  return (1e3 * repair.at_m - Eigen::Vector3d(x, y, z)).norm();
}

// From a point of the tree to its root [m].
double wayToRoot(const VesselTree& tree, int point) {
  double way = 0;
  for (int parent = tree.parents()[point]; parent >= 0; point = parent, parent = tree.parents()[point]) {
    way += (tree.points().col(point) - tree.points().col(parent)).norm();
  }
  return way;
}

// What share of the truth the tree has, and the other way round, within a voxel.
double covered(const char* what, const VesselTree& truth, const ExtractedTree& found) {
  const Coverage of_truth = coverage(truth, found.tree, kVoxelOfTubes),
                 of_tree = coverage(found.tree, truth, kVoxelOfTubes);
  std::printf("%s: %.1f %% of the truth and %.1f %% of the tree within a voxel, %.2f and %.2f mm at most\n", what,
              100 * of_truth.share, 100 * of_tree.share, 1e3 * of_truth.worst_m, 1e3 * of_tree.worst_m);
  return of_truth.share;
}

TEST(Cycles, RingIsCutAcrossFromTheRootWhichIsAnArmsEnd) {
  // A ring of equal thickness between two thinner arms, the right one wider: its thinnest place is the voxels' noise.
  const VesselTree truth = treeOf({{arc({0, 0}, 15, 0, 2 * kPi, 0), 2.0},
                                   {line({15, 0, 0}, {40, 0, 3}), 1.8},
                                   {line({-15, 0, 0}, {-35, 2, 0}), 1.2}});
  const ExtractedTree found = extractTree(segmented(truth), {});
  const auto cycles = repairsOf(found.repairs, Flaw::kCycle);
  ASSERT_EQ(cycles.size(), 1U);
  EXPECT_EQ(found.repairs.size(), 1U);
  EXPECT_LT(apart_mm(cycles.front(), -15, 0, 0), 4);
  EXPECT_NEAR(cycles.front().radius_m, 2e-3, 0.6 * kVoxelOfTubes);
  // A chain of voxels is longer than the line they stand for: by 8 % if its directions are even.
  EXPECT_GT(cycles.front().length_m, 2 * kPi * 15e-3);
  EXPECT_LT(cycles.front().length_m, 1.15 * 2 * kPi * 15e-3);
  ASSERT_EQ(roots(found.tree), 1);
  for (int i = 0; i < found.tree.size(); ++i) {
    const Eigen::Vector3d p_mm = 1e3 * found.tree.points().col(i);
    EXPECT_TRUE(found.tree.parents()[i] >= 0 || p_mm.x() > 38) << p_mm.transpose();
    // 25 mm of arm, half a ring of 47 mm, 20 mm of arm, and the caps.
    EXPECT_LT(wayToRoot(found.tree, i), 100e-3);
  }
  EXPECT_GT(covered("ring", truth, found), 0.95);
}

TEST(Cycles, SiphonIsPartedFromItselfWhereItTouches) {
  // A whole turn whose ends overlap, by a tenth and by a quarter of the vessel's width. Of the latter the skeleton has
  // two ways across, and one of them is the vessel.
  for (const double rise_mm : {3.6, 3.0}) {
    const auto turn = arc({0, 9}, 9, -kPi / 2, 3 * kPi / 2, rise_mm);
    Vessel siphon{line({-30, 0, 0}, {-1, 0, 0}), 2.0};
    siphon.points_mm.insert(siphon.points_mm.end(), turn.begin(), turn.end());
    const auto last = line({1, 0, rise_mm}, {30, 0, rise_mm});
    siphon.points_mm.insert(siphon.points_mm.end(), last.begin(), last.end());
    const VesselTree truth = treeOf({siphon});
    const ExtractedTree found = extractTree(segmented(truth), {});
    const auto touches = repairsOf(found.repairs, Flaw::kSelfTouch);
    ASSERT_EQ(touches.size(), 1U);
    EXPECT_EQ(found.count(Flaw::kCycle), 0);
    EXPECT_LT(apart_mm(touches.front(), 0, 0, rise_mm / 2), 4);  // The turn's other side is 18 mm away.
    EXPECT_EQ(found.tree.branches().size(), 1U);
    EXPECT_NEAR(found.tree.length(), truth.length() + 4e-3, 2e-3);  // And a cap at each end.
    EXPECT_GT(covered("siphon", truth, found), 0.98);
  }
}

TEST(Cycles, TurnsOfAHelixTouchAllTheWayAndStayOneVessel) {
  Vessel helix{line({8, -25, 0}, {8, -1, 0}), 2.0};
  const auto turns = arc({0, 0}, 8, 0, 4 * kPi, 7.6);
  helix.points_mm.insert(helix.points_mm.end(), turns.begin(), turns.end());
  const auto last = line({8, 1, 7.6}, {8, 25, 7.6});
  helix.points_mm.insert(helix.points_mm.end(), last.begin(), last.end());
  const VesselTree truth = treeOf({helix});
  const ExtractedTree found = extractTree(segmented(truth), {});
  EXPECT_GE(found.count(Flaw::kSelfTouch), 1);
  EXPECT_EQ(found.tree.branches().size(), 1U);
  EXPECT_NEAR(found.tree.length(), truth.length() + 4e-3, 3e-3);
  EXPECT_GT(covered("helix", truth, found), 0.98);
}

TEST(Cycles, KissingVesselsArePartedOrKept) {
  CentrelineSettings keeping;
  keeping.kissing = KissingRule::kKeep;
  for (const double overlap_mm : {0.2, 0.4, 0.6}) {
    const double apart = 4 - overlap_mm;
    const VesselTree truth =
        treeOf({{line({-25, 0, 0}, {25, 0, 0}), 2.0}, {line({0, -25, apart}, {0, 25, apart}), 2.0}});
    const Volume shape = segmented(truth);
    const ExtractedTree parted = extractTree(shape, {});
    ASSERT_EQ(repairsOf(parted.repairs, Flaw::kKissing).size(), 1U);
    EXPECT_LT(apart_mm(repairsOf(parted.repairs, Flaw::kKissing).front(), 0, 0, apart / 2), 1.5);
    EXPECT_EQ(roots(parted.tree), 2);
    EXPECT_EQ(parted.tree.branches().size(), 2U);
    EXPECT_NEAR(parted.tree.length(), truth.length() + 8e-3, 2e-3);
    EXPECT_GT(covered("kissing", truth, parted), 0.98);
    const ExtractedTree kept = extractTree(shape, keeping);
    EXPECT_TRUE(repairsOf(kept.repairs, Flaw::kKissing).empty());
    EXPECT_EQ(roots(kept.tree), 1);
  }
}

TEST(Cycles, ForksCloseTogetherAreNoContact) {
  // Two branches on opposite sides, 3.5 mm apart along the trunk; and a branch that forks as a T after 8 mm.
  const VesselTree truth = treeOf({{line({-25, 0, 0}, {25, 0, 0}), 2.0},
                                   {line({0, 0, 0}, {5, 20, 0}), 1.5},
                                   {line({3.5, 0, 0}, {8, -20, 0}), 1.5},
                                   {line({-15, 0, 0}, {-15, 0, 8}), 1.6},
                                   {line({-15, -15, 8}, {-15, 15, 8}), 1.3}});
  const ExtractedTree found = extractTree(segmented(truth), {});
  for (const Repair& repair : found.repairs) EXPECT_EQ(repair.flaw, Flaw::kStub);
  EXPECT_EQ(roots(found.tree), 1);
  EXPECT_EQ(found.tree.branches().size(), 9U);
}

TEST(Cycles, BulgeIsNoBranchAndSaysSo) {
  // A ball at the side of a vessel; then one three times as wide as the vessel, an aneurysm.
  for (const auto& [ball_mm, off_mm] : {std::pair(3.5, 3.5), std::pair(6.0, 7.0)}) {
    const VesselTree truth =
        treeOf({{line({-25, 0, 0}, {25, 0, 0}), 2.0}, {line({0, off_mm, 0}, {0, off_mm + 0.1, 0}), ball_mm}});
    const ExtractedTree found = extractTree(segmented(truth), {});
    EXPECT_EQ(found.tree.branches().size(), 1U);
    const auto stubs = repairsOf(found.repairs, Flaw::kStub);
    ASSERT_EQ(stubs.size(), 1U);
    EXPECT_LT(apart_mm(stubs.front(), 0, 0, 0), 3);
    EXPECT_GT(stubs.front().length_m, 1e-3);
    EXPECT_LT(stubs.front().length_m, (off_mm + ball_mm - 1.5) / 1e3);  // From the wall to the ball's far side.
  }
}

TEST(Cycles, AreRefusedWhenAsked) {
  const VesselTree truth = treeOf({{arc({0, 0}, 12, 0, 2 * kPi, 0), 2.0}, {line({12, 0, 0}, {30, 0, 0}), 2.0}});
  CentrelineSettings settings;
  settings.cycles = CycleRule::kRefuse;
  const std::string refusal = refusalOf([&] { extractTree(segmented(truth), settings); });
  EXPECT_NE(refusal.find("cycles = 1: must be none"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("mm round"), std::string::npos) << refusal;
}

// What README.md names as limits: the lines are there, the contact is not seen, the point of the bend is cut off.
TEST(Cycles, DeepContactsAndSharpBendsAreLimits) {
  const VesselTree deep = treeOf({{line({-25, 0, 0}, {25, 0, 0}), 2.0}, {line({0, -25, 2.8}, {0, 25, 2.8}), 2.0}});
  const ExtractedTree crossed = extractTree(segmented(deep), {});
  EXPECT_EQ(roots(crossed.tree), 1);
  EXPECT_GT(covered("crossing, a third of the width overlaps", deep, crossed), 0.95);
  std::vector<Eigen::Vector3d> bend = line({-25, 0, 0}, {-1, 0, 0});
  const auto back = line({0, 0, 0}, {-18, 15, 0});
  bend.insert(bend.end(), back.begin(), back.end());
  const VesselTree sharp = treeOf({{bend, 2.5}});
  const ExtractedTree bent = extractTree(segmented(sharp), {});
  EXPECT_EQ(bent.tree.branches().size(), 1U);
  EXPECT_GT(covered("bend of 140 degrees", sharp, bent), 0.75);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// Surfaces as they come: cut open, in pieces, turned inside out, with corners that nearly meet. Each must fill the same
// voxels as the clean one, and be told of.
#include <gtest/gtest.h>

#include <algorithm>

#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/volume/mesh_files.hpp"
#include "phantom.hpp"
#include "surfaces.hpp"

namespace angio::test {
namespace {

constexpr double kVoxelOfMesh = 0.5e-3;

FilledMesh filled(const std::vector<Triangle>& triangles) {
  const TemporaryFolder folder;
  return readMesh(folder.write("surface.stl", binaryStl(triangles)), kVoxelOfMesh, PatientFrame::kLps);
}

std::vector<Triangle> closedPipe() { return together(together(openPipe(), pipeDisc(40)), turnedRound(pipeDisc(0))); }

long voxelsOf(const VoxelMask& mask) { return std::count(mask.inside.begin(), mask.inside.end(), std::uint8_t{1}); }

TEST(ClosedShells, CleanPipeHasItsVolumeAndNoFlaw) {
  const FilledMesh pipe = filled(closedPipe());
  EXPECT_TRUE(pipe.repairs.empty());
  // Of a prism with 48 sides; a layer of voxels at each end is half in.
  const double area = 0.5 * kPipeSides * std::sin(2 * kPi / kPipeSides) * 9e-6;
  EXPECT_NEAR(static_cast<double>(voxelsOf(pipe.mask)) * std::pow(kVoxelOfMesh, 3), area * 40e-3, 0.02 * area * 40e-3);
}

TEST(ClosedShells, OpenEndsAreClosedWhereTheyAre) {
  const FilledMesh pipe = filled(openPipe());
  EXPECT_EQ(pipe.mask.inside, filled(closedPipe()).mask.inside);
  auto ends = repairsOf(pipe.repairs, Flaw::kOpenEnd);
  ASSERT_EQ(ends.size(), 2U);
  EXPECT_EQ(pipe.repairs.size(), 2U);
  std::sort(ends.begin(), ends.end(), [](const Repair& a, const Repair& b) { return a.at_m.z() < b.at_m.z(); });
  for (int i = 0; i < 2; ++i) {
    const Repair& end = ends[static_cast<std::size_t>(i)];
    EXPECT_LT((end.at_m - Eigen::Vector3d(20e-3, 30e-3, 40e-3 * i)).norm(), 1e-6);
    EXPECT_NEAR(end.radius_m, 3e-3, 0.01e-3);  // The border has 48 corners.
  }
}

TEST(ClosedShells, NormalsDoNotMatter) {
  const VoxelMask expected = filled(closedPipe()).mask;
  const FilledMesh inward = filled(turnedRound(closedPipe()));
  EXPECT_EQ(inward.mask.inside, expected.inside);
  EXPECT_EQ(repairsOf(inward.repairs, Flaw::kInwardNormals).size(), 1U);
  EXPECT_TRUE(repairsOf(inward.repairs, Flaw::kMixedNormals).empty());
  // Lids the wrong way round: the 48 edges of each.
  const FilledMesh mixed = filled(together(openPipe(), together(pipeDisc(0), turnedRound(pipeDisc(40)))));
  EXPECT_EQ(mixed.mask.inside, expected.inside);
  ASSERT_EQ(repairsOf(mixed.repairs, Flaw::kMixedNormals).size(), 1U);
  EXPECT_EQ(repairsOf(mixed.repairs, Flaw::kMixedNormals).front().count, 2 * kPipeSides);
  EXPECT_TRUE(repairsOf(mixed.repairs, Flaw::kInwardNormals).empty());
}

TEST(ClosedShells, PointsThatNearlyMeetAndTrianglesGivenTwiceAreOne) {
  std::vector<Triangle> triangles = closedPipe();
  Random random(5);
  const auto off = [&] { return static_cast<float>(random.uniform(-1e-3, 1e-3)); };  // A thousandth of a millimetre.
  for (Triangle& t : triangles) {
    for (Eigen::Vector3f& corner : t) corner += Eigen::Vector3f(off(), off(), off());
  }
  const FilledMesh rough = filled(triangles);
  const long clean = voxelsOf(filled(closedPipe()).mask);
  // Lids lie on voxels' centres: half of one layer at each end goes with the corners.
  EXPECT_NEAR(static_cast<double>(voxelsOf(rough.mask)), static_cast<double>(clean), 0.03 * static_cast<double>(clean));
  ASSERT_EQ(repairsOf(rough.repairs, Flaw::kJoinedPoints).size(), 1U);
  EXPECT_LE(repairsOf(rough.repairs, Flaw::kJoinedPoints).front().length_m, 2 * std::sqrt(3.0) * 1.001e-6);
  EXPECT_TRUE(repairsOf(rough.repairs, Flaw::kOpenEnd).empty());

  const std::vector<Triangle> all = closedPipe();
  const FilledMesh twice = filled(together(all, {all.begin(), all.begin() + 30}));
  EXPECT_EQ(twice.mask.inside, filled(all).mask.inside);
  ASSERT_EQ(repairsOf(twice.repairs, Flaw::kDoubleTriangle).size(), 1U);
  EXPECT_EQ(repairsOf(twice.repairs, Flaw::kDoubleTriangle).front().count, 30);
}

TEST(ClosedShells, ShellsThatOverlapOrLieInOneAnotherAreTheirUnion) {
  // Along z and along x through the same middle: where they overlap a ray crosses an even number of walls.
  std::vector<Triangle> across = closedPipe();
  for (Triangle& t : across) {
    for (Eigen::Vector3f& c : t) c = Eigen::Vector3f(c.z(), 30 + (c.y() - 30) / 2, 20 + (c.x() - 20) / 2);
  }
  const FilledMesh both = filled(together(closedPipe(), across));
  EXPECT_EQ(repairsOf(both.repairs, Flaw::kShell).size(), 2U);
  const auto inside = [&](double x, double y, double z) {
    const Eigen::Vector3d index = both.mask.grid.indexAt(Eigen::Vector3d(x, y, z) / 1e3);
    return both.mask.inside[both.mask.grid.offset(index.array().round().cast<int>().matrix())] == 1;
  };
  EXPECT_TRUE(inside(20, 30, 20));  // In both.
  EXPECT_TRUE(inside(20, 30, 5));
  EXPECT_TRUE(inside(5, 30, 20));
  EXPECT_FALSE(inside(5, 30, 5));

  std::vector<Triangle> lumen = closedPipe();
  for (Triangle& t : lumen) {
    for (Eigen::Vector3f& c : t) c = Eigen::Vector3f(20 + (c.x() - 20) / 2, 30 + (c.y() - 30) / 2, 5 + c.z() / 2);
  }
  EXPECT_EQ(filled(together(closedPipe(), lumen)).mask.inside, filled(closedPipe()).mask.inside);
}

TEST(ClosedShells, InnerWallDoesNotDivide) {
  // As a mesh of two blocks has: their interface is a wall across the pipe.
  const std::vector<Triangle> blocks = together(openPipe(0, 17.3F), openPipe(17.3F, 40));
  const std::vector<Triangle> lids = together(pipeDisc(40), turnedRound(pipeDisc(0)));
  const FilledMesh divided = filled(together(together(blocks, lids), pipeDisc(17.3F)));
  EXPECT_EQ(divided.mask.inside, filled(closedPipe()).mask.inside);
  const auto walls = repairsOf(divided.repairs, Flaw::kInnerWall);
  ASSERT_EQ(walls.size(), 1U);
  EXPECT_LT((walls.front().at_m - Eigen::Vector3d(20e-3, 30e-3, 17.3e-3)).norm(), 1e-6);
  EXPECT_TRUE(repairsOf(divided.repairs, Flaw::kOpenEnd).empty());
}

}  // namespace
}  // namespace angio::test

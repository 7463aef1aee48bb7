// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>

#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::TemporaryFolder;

const std::string kHead = "# vtk DataFile Version 2.0\nComment goes here\nASCII\nDATASET ";

TEST(VtkFiles, LinesInAnyOrderAndDirectionGrowFromTheFirst) {
  const TemporaryFolder folder;
  // A trunk, a branch of a branch that stands before it, and a branch that is stored towards the trunk; numbers break
  // over lines as programs write them.
  const VesselTree tree = readVesselTree(folder.write(
      "t.vtk", kHead + "POLYDATA\nPOINTS 7 double\n0 0 0 10 0\n 0 20 0 0 20\n10 0 20 20 0 20 30 0 10 0 7\n"
                       "LINES 4 14\n3 0 1 2\n2 4 5\n3 4\n3 2\n2 6 1\nPOINT_DATA 7\nSCALARS a float\n1 2 3 4 5 6 7\n"));
  ASSERT_EQ(tree.size(), 7);
  EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 1);
  EXPECT_EQ(tree.parents()[0], -1);
  EXPECT_DOUBLE_EQ(tree.length(), 0.057);
  for (int i = 1; i < tree.size(); ++i) {  // Every edge leads away from the inlet.
    EXPECT_GT(tree.points().col(i).sum(), tree.points().col(tree.parents()[static_cast<std::size_t>(i)]).sum());
  }
}

TEST(VtkFiles, CoincidentEndsAreOnePointThoughTheirNumbersDiffer) {
  const TemporaryFolder folder;
  const VesselTree tree = readVesselTree(folder.write(
      "t.vtk", kHead + "UNSTRUCTURED_GRID\nPOINTS 6 float\n0 0 0\n10 0 0\n10 0 0\n20 5 0\n10 0 0\n20 -5 0\n"
                       "CELLS 3 9\n2 0 1\n2 2 3\n2 4 5\nCELL_TYPES 3\n4\n4\n4\n"));
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, 1, 1}));
}

TEST(VtkFiles, LinesThatAllStopOnePointEarlyReachTheirBranchsEnd) {
  const TemporaryFolder folder;
  // As above, one more point in each branch's list than its line has: without it the branches would not meet.
  const VesselTree tree = readVesselTree(folder.write(
      "t.vtk", kHead +
                   "UNSTRUCTURED_GRID\nPOINTS 9 float\n0 0 0\n5 0 0\n10 0 0\n10 0 0\n15 2 0\n20 5 0\n10 0 0\n15 -2 0\n"
                   "20 -5 0\nCELLS 3 9\n2 0 1\n2 3 4\n2 6 7\nCELL_TYPES 3\n4\n4\n4\n"));
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, 1, 2, 3, 2, 5}));
  EXPECT_EQ(tree.branches().size(), 3U);
}

TEST(VtkFiles, LinesThatNeverMeetAreAForest) {
  const TemporaryFolder folder;
  const VesselTree tree = readVesselTree(folder.write(
      "t.vtk", kHead + "POLYDATA\nPOINTS 4 float\n0 0 0\n5 0 0\n0 50 0\n5 50 0\nLINES 2 6\n2 0 1\n2 2 3\n"));
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, -1, 2}));
}

}  // namespace
}  // namespace angio::test

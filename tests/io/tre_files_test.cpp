// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <random>

#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/test/text.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

// As ITK's MetaIO writes them: a trunk whose points are voxels of 0.5 mm, turned about z, and a branch at its second
// point.
const std::string kTre =
    "ObjectType = Scene\nNDims = 3\nNObjects = 2\n"
    "ObjectType = Tube\nObjectSubType = Vessel\nNDims = 3\nName = trunk\nID = 1\nBinaryData = False\n"
    "TransformMatrix = 0 -1 0 1 0 0 0 0 1\nOffset = 100 0 0\nCenterOfRotation = 0 0 0\nElementSpacing = 0.5 0.5 2\n"
    "Root = True\nArtery = True\nPointDim = id x y z red r v1x\nNPoints = 3\nPoints = \n"
    "0 10 0 0 1 4 0 \n1 20 0 0 1 4 0 \n2 30 0 5 1 0 0 \n"
    "ObjectType = Tube\nObjectSubType = Vessel\nNDims = 3\nID = 2\nParentID = 1\nBinaryData = False\nParentPoint = 1\n"
    "Root = False\nPointDim = x y z r\nNPoints = 2\nPoints = \n100 10 3 1\n100 10 6 1\n";

TEST(TreFiles, TubesStandInTheirPlaceAndHangTogether) {
  const TemporaryFolder folder;
  const VesselTree tree = readVesselTree(folder.write("t.tre", kTre));
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, 1, 1, 3}));
  // Turned by the matrix, row by row: x of the voxels is y here.
  EXPECT_LT((tree.points().col(0) - Eigen::Vector3d(0.1, 0.005, 0)).norm(), 1e-15);
  EXPECT_LT((tree.points().col(2) - Eigen::Vector3d(0.1, 0.015, 0.01)).norm(), 1e-15);
  EXPECT_LT((tree.points().col(3) - Eigen::Vector3d(0.1, 0.01, 0.003)).norm(), 1e-15);
  EXPECT_DOUBLE_EQ(*tree.radii()[0], 0.002);  // In voxels, too.
  EXPECT_FALSE(tree.radii()[2]);
  EXPECT_DOUBLE_EQ(*tree.radii()[4], 0.001);
}

TEST(TreFiles, ErrorsNameLineFieldAndRule) {
  const TemporaryFolder folder;
  const std::pair<std::string, std::string> cases[] = {
      {"", ":1: ObjectType: there must be a Tube"},
      {with(kTre, "NDims = 3\nName", "NDims = 2\nName"), ":6: NDims = 2: must lie between 3 and 3"},
      {with(kTre, "ObjectType = Tube", "ObjectType = Blob"), ":4: ObjectType = Blob: must be Tube"},
      {with(kTre, "BinaryData = False", "BinaryData = True"), ":9: BinaryData = True: must be False"},
      {with(kTre, "Offset = 100 0 0", "Offset = 100 0"), ":11: Offset = 2: must be 3 numbers"},
      {with(kTre, "0.5 0.5 2", "0.5 nan 2"), ":13: ElementSpacing = nan"},
      {with(kTre, "id x y z red", "id x y y red"), ":16: PointDim: y must be named once"},
      {with(kTre, "NPoints = 3", "NPoints = 4"), ":22: columns = 3: must be 7, as PointDim says"},
      {with(kTre, "NPoints = 3", "NPoints = 2000001"), ":17: NPoints = 2000001"},
      {with(kTre, "NPoints = 3\n", ""), "NPoints: is missing"},
      {with(kTre, "NPoints = 3", "NPoints = 2"), ":21: line = 2 30 0 5 1 0 0: must be key = value"},
      {with(kTre, "1 20 0 0", "1 20 zero 0"), ":20: y = zero: must be a number"},
      {with(kTre, "1 20 0 0", "1 1e9 0 0"), "must lie within 10,000 mm"},
      {with(kTre, "ParentPoint = 1", "ParentPoint = 3"), "ParentPoint = 3: must be a point of tube 1, 0 to 2"},
      {with(kTre, "ID = 2", "ID = 1"), "ID = 1: must be unique"},
      {with(kTre, "ParentID = 1", "ParentID = 2"), "the tree must not have a loop"},
      {kTre.substr(0, kTre.size() - 11), "points = 1: must be 2"},
      {kTre.substr(0, kTre.find("NPoints")), ":4: Points: is missing"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string path = folder.write("t.tre", content);
    const std::string message = refusalOf([&] { readVesselTree(path); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
    EXPECT_EQ(message.find(path), 0U) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(TreFiles, CutOrChangedFilesAreReadOrRefused) {
  const TemporaryFolder folder;
  std::mt19937 random(5);
  int refused = 0;
  const auto tryTo = [&](const std::string& content) {
    try {
      readVesselTree(folder.write("t.tre", content));
    } catch (const InputError&) {
      ++refused;
    }
  };
  for (std::size_t length = 0; length < kTre.size(); ++length) tryTo(kTre.substr(0, length));
  for (int trial = 0; trial < 2000; ++trial) {
    std::string bad = kTre;
    for (int change = 0; change <= trial % 3; ++change) bad[random() % bad.size()] = static_cast<char>(random());
    tryTo(bad);
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace angio::test

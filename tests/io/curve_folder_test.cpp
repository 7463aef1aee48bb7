// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/curve_folder.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>

#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/shared_data.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

// One curve with a radius of 2 mm everywhere.
std::string curveText(const std::vector<Eigen::Vector3d>& points_mm) {
  std::string points, radii;
  for (const Eigen::Vector3d& p : points_mm) {
    const std::string comma = points.empty() ? "" : ",";
    points += comma + "{\"position\":[" + std::to_string(p.x()) + "," + std::to_string(p.y()) + "," +
              std::to_string(p.z()) + "]}";
    radii += comma + "2";
  }
  return "{\"markups\":[{\"type\":\"Curve\",\"coordinateSystem\":\"LPS\",\"controlPoints\":[" + points +
         "],\"measurements\":[{\"name\":\"Radius\",\"controlPointValues\":[" + radii + "]}]}]}\n";
}

struct CurveFolder : testing::Test {
  void SetUp() override {
    folder.write("Curve (0).mrk.json", curveText({{0, 0, 0}, {10, 0, 0}, {20, 0, 0}, {30, 0, 0}}));
    folder.write("Curve - LVA.mrk.json", curveText({{10, 0, 0}, {15, 10, 0}, {20, 20, 0}}));
    folder.write("notes.txt", "no curve");
  }
  std::string refusal() const {
    return refusalOf([&] { readVesselTree(folder.path()); });
  }
  TemporaryFolder folder;
};

TEST_F(CurveFolder, IsOneTreeWhereCurvesShareAPoint) {
  const VesselTree tree = readVesselTree(folder.path());
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, 1, 2, 1, 4}));
  EXPECT_EQ(tree.points().col(5), Eigen::Vector3d(0.020, 0.020, 0));
  EXPECT_DOUBLE_EQ(*tree.radii()[4], 2e-3);
}

TEST_F(CurveFolder, BranchesAreCalledAsTheirCurves) {
  EXPECT_EQ(branchNames(readVesselTree(folder.path()), readCurveFolder(folder.path())),
            (std::vector<std::string>{"Curve (0)", "Curve - LVA", "Curve (0)"}));
}

TEST_F(CurveFolder, ACurveHangsWhereItBeginsInsideAnother) {
  folder.write("Curve (1).mrk.json", curveText({{30, 1.5, 0}, {40, 1.5, 0}}));
  const VesselTree tree = readVesselTree(folder.path());
  ASSERT_EQ(tree.size(), 8);
  EXPECT_EQ(tree.points().col(6), Eigen::Vector3d(0.030, 0.0015, 0));
  EXPECT_EQ(tree.parents()[6], 3);
}

TEST_F(CurveFolder, ACurveMayPointTheOtherWay) {
  folder.write("Curve (1).mrk.json", curveText({{40, 1.5, 0}, {30, 1.5, 0}}));
  const VesselTree tree = readVesselTree(folder.path());
  ASSERT_EQ(tree.size(), 8);
  EXPECT_EQ(tree.points().col(6), Eigen::Vector3d(0.030, 0.0015, 0));
  EXPECT_EQ(tree.points().col(7), Eigen::Vector3d(0.040, 0.0015, 0));
}

TEST_F(CurveFolder, ARingStaysOpenInFrontOfWhereItWouldClose) {
  folder.write("Curve - RVA.mrk.json", curveText({{30, 0, 0}, {30, 10, 0}, {20, 20, 0}}));
  const VesselTree tree = readVesselTree(folder.path());
  ASSERT_EQ(tree.size(), 7);
  EXPECT_EQ(tree.points().col(6), Eigen::Vector3d(0.030, 0.010, 0));
  EXPECT_EQ(tree.branches().size(), 3U);
}

TEST_F(CurveFolder, NamesAreTheFilesOrTheirLastWord) {
  const std::vector<NamedCurve> curves = readCurveFolder(folder.path());
  ASSERT_EQ(curves.size(), 2U);
  EXPECT_EQ(&curveOfName("f", curves, "LVA"), &curves[1]);
  EXPECT_EQ(&curveOfName("f", curves, "Curve (0)"), &curves[0]);
  EXPECT_EQ(refusalOf([&] { curveOfName("f", curves, "VA"); }),
            "f: curve = VA: must be the name of a curve, or its last word");
}

TEST_F(CurveFolder, RefusalsAreOneLineThatNamesFileAndRule) {
  const std::string far = folder.write("Curve (9).mrk.json", curveText({{100, 0, 0}, {110, 0, 0}}));
  EXPECT_NE(refusal().find("Curve (9)"), std::string::npos) << refusal();
  EXPECT_NE(refusal().find("must begin, end or have a point on another curve"), std::string::npos) << refusal();
  folder.write("Curve (9).mrk.json", "{");
  EXPECT_EQ(refusal().find(far), 0U) << refusal();
  EXPECT_EQ(refusal().find('\n'), std::string::npos);
  const TemporaryFolder empty;
  EXPECT_NE(refusalOf([&] { readVesselTree(empty.path()); }).find("is a folder without a file *.mrk.json"),
            std::string::npos);
}

// An aortic arch with carotid and vertebral arteries, drawn by others: 25 curves, one of them to both vertebrals' end.
TEST(CurveFolderOfOthers, IsOneTreeFromItsFirstCurve) {
  NEED_SHARED_DATA("steve-dualdevicenav");
  const std::string folder = test::sharedData("steve-dualdevicenav");
  const std::vector<NamedCurve> curves = readCurveFolder(folder);
  ASSERT_EQ(curves.size(), 25U);
  const VesselTree tree = readVesselTree(folder);
  EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 1);
  EXPECT_EQ(tree.points().col(0), Eigen::Vector3d(curves[0].points_mm.col(0) / 1e3));
  EXPECT_TRUE(std::all_of(tree.radii().begin(), tree.radii().end(), [](const auto& r) { return r.has_value(); }));
  // Every curve's points are there, but for the one point in which the vertebral arteries meet a second time.
  std::set<std::array<double, 3>> places, drawn;
  for (int i = 0; i < tree.size(); ++i) places.insert({tree.points()(0, i), tree.points()(1, i), tree.points()(2, i)});
  for (const NamedCurve& c : curves) {
    for (const auto& p : c.points_mm.colwise()) drawn.insert({p.x() / 1e3, p.y() / 1e3, p.z() / 1e3});
  }
  EXPECT_EQ(places, drawn);
  EXPECT_EQ(places.size(), static_cast<std::size_t>(tree.size()));
}

}  // namespace
}  // namespace angio::test

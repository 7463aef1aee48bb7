// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <locale>
#include <map>

#include "angio/io/centerline_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

TEST(VesselFiles, RoundTripKeepsEveryNumber) {
  const TemporaryFolder folder;
  const VesselTree tree = test::branchingTree(3);
  for (const char* name : {"tree.csv", "tree.SWC"}) {
    writeVesselTree(folder.path(name), tree);
    const VesselTree back = readVesselTree(folder.path(name));
    EXPECT_EQ(back.parents(), tree.parents()) << name;
    // A number in metres need not have an exact neighbour in millimetres: two roundings of 1e-16 of 0.2 m.
    EXPECT_LT((back.points() - tree.points()).cwiseAbs().maxCoeff(), 1e-16) << name;
    for (int i = 0; i < tree.size(); ++i) EXPECT_DOUBLE_EQ(*back.radii()[i], *tree.radii()[i]) << name;
  }
}

TEST(VesselFiles, WritingWhatWasReadGivesTheSameText) {
  const TemporaryFolder folder;
  const std::string text = "id,x_mm,y_mm,z_mm,radius_mm,parent\n0,40.8,0.1,-7.000001,,-1\n1,1e-05,3,1234.5678,2.35,0\n";
  writeVesselTree(folder.path("b.csv"), readVesselTree(folder.write("a.csv", text)));
  EXPECT_EQ(test::contentOf(folder.path("b.csv")), text);
}

TEST(VesselFiles, ReadsClinicalExample) {
  const VesselTree tree = readVesselTree(test::exampleData("hepatic-tace/tree.csv"));
  EXPECT_EQ(tree.size(), 728);
  EXPECT_EQ(std::count(tree.parents().begin(), tree.parents().end(), -1), 1);
  EXPECT_FALSE(tree.radii()[0]);
  EXPECT_NEAR(tree.points()(1, 0), 0.086582411, 1e-15);  // Millimetres in the file, metres here.
}

TEST(VesselFiles, CsvIdsNeedNoOrder) {
  const TemporaryFolder folder;
  const VesselTree tree = readVesselTree(folder.write(
      "t.csv", "\xef\xbb\xbfparent,id,x_mm,y_mm,z_mm,radius_mm\r\n70,-5,1,2,3,\r\n-1,70,4,5,6,1.5\r\n70,9,7,8,9,\r\n"));
  EXPECT_EQ(tree.parents(), (std::vector<int>{1, -1, 1}));
  EXPECT_EQ(tree.points().col(1), Eigen::Vector3d(0.004, 0.005, 0.006));
  EXPECT_FALSE(tree.radii()[0]);
  EXPECT_DOUBLE_EQ(*tree.radii()[1], 0.0015);
}

TEST(VesselFiles, SwcSkipsCommentsAndUnknownRadii) {
  const TemporaryFolder folder;
  const VesselTree tree = readVesselTree(
      folder.write("t.swc", "# made by hand\n\n 1 2 0 0 0 1.5 -1\n2\t2 0 0 10 0 1 # no radius\n3 2 0 10 10 -1 2\n"));
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, 1}));
  EXPECT_TRUE(tree.radii()[0]);
  EXPECT_FALSE(tree.radii()[1]);
  EXPECT_FALSE(tree.radii()[2]);
  EXPECT_DOUBLE_EQ(tree.length(), 0.020);
}

TEST(VesselFiles, HmmTextIsWalkedFromItsRoot) {
  const TemporaryFolder folder;
  const std::string rest = ";0;0;0;2.5;0;0;0;0;0;0;0;0;0;\n";
  // The root is point 2; 1 is a bifurcation.
  const VesselTree tree = readVesselTree(folder.write(
      "t.txt", "4\n2\n10;0;0" + rest + "1;\n20;0;0" + rest + "0;2;3;\n30;0;0" + rest + "1;\n20;5;0" + rest + "1;\n"));
  EXPECT_EQ(tree.parents(), (std::vector<int>{1, 2, -1, 1}));
  EXPECT_DOUBLE_EQ(*tree.radii()[0], 0.0025);
  EXPECT_DOUBLE_EQ(tree.points()(1, 3), 0.005);
}

// Points with their parent's: what stays when points stand in another order.
std::map<std::array<double, 3>, std::array<double, 4>> edgesOf(const VesselTree& tree) {
  std::map<std::array<double, 3>, std::array<double, 4>> edges;
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    const Eigen::Vector3d p = tree.points().col(i), q = parent < 0 ? p : Eigen::Vector3d(tree.points().col(parent));
    edges[{p.x(), p.y(), p.z()}] = {q.x(), q.y(), q.z(), tree.radii()[static_cast<std::size_t>(i)].value_or(-1)};
  }
  return edges;
}

// A tree as a file has it, so that another file can give back the very same numbers; three radii are unknown.
VesselTree writtenTree(const TemporaryFolder& folder) {
  const VesselTree tree = test::branchingTree(5);
  auto radii = tree.radii();
  radii[0] = radii[7] = radii[30] = std::nullopt;
  writeVesselTree(folder.path("source.csv"), VesselTree(tree.points(), tree.parents(), radii));
  return readVesselTree(folder.path("source.csv"));
}

TEST(VesselFiles, FormatsByBranchGiveBackTheSameTree) {
  const TemporaryFolder folder;
  const VesselTree tree = writtenTree(folder);
  for (const char* name : {"tree.mrk.json", "tree.tre", "TREE.MRK.JSON"}) {
    writeVesselTree(folder.path(name), tree);
    const VesselTree back = readVesselTree(folder.path(name));
    EXPECT_EQ(back.branches().size(), tree.branches().size()) << name;
    EXPECT_EQ(edgesOf(back), edgesOf(tree)) << name;
  }
}

TEST(VesselFiles, LinesToEachEndGiveBackTheSameTree) {
  const TemporaryFolder folder;
  const VesselTree tree = writtenTree(folder);
  writeVesselTree(folder.path("tree.vtp"), tree);
  const VesselTree back = readVesselTree(folder.path("tree.vtp"));
  EXPECT_EQ(back.branches().size(), tree.branches().size());
  // Reading drops what follows the trunk within a tenth of its radius, 0.25 mm: at each of 15 forks some of a step.
  EXPECT_NEAR(back.length(), tree.length(), 15 * 0.5e-3);
  const auto edges = edgesOf(tree);
  for (const auto& [point, edge] : edgesOf(back)) EXPECT_TRUE(edges.count(point) > 0);
}

TEST(VesselFiles, FrameTurnsXAndYUnlessTheFileSaysIt) {
  const TemporaryFolder folder;
  const VesselTree tree = writtenTree(folder);
  for (const char* name : {"tree.swc", "tree.tre"}) {
    writeVesselTree(folder.path(name), tree, PatientFrame::kRas);
    EXPECT_FALSE(saysItsFrame(folder.path(name)));
    EXPECT_EQ(edgesOf(withOtherFrame(readVesselTree(folder.path(name)))), edgesOf(tree)) << name;
  }
  for (const char* name : {"tree.csv", "tree.mrk.json"}) {
    for (const PatientFrame frame : {PatientFrame::kLps, PatientFrame::kRas}) {
      writeVesselTree(folder.path(name), tree, frame);
      EXPECT_TRUE(saysItsFrame(folder.path(name)));
      EXPECT_EQ(edgesOf(readVesselTree(folder.path(name))), edgesOf(tree)) << name;
    }
    EXPECT_NE(test::contentOf(folder.path(name)).find("RAS"), std::string::npos) << name;
  }
  writeVesselTree(folder.path("plain.csv"), tree);
  EXPECT_FALSE(saysItsFrame(folder.path("plain.csv")));
}

TEST(VesselFiles, CsvInRasIsTurnedAndSaysOneFrameInAllRows) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& first, const std::string& second) {
    return readVesselTree(folder.write(
        "t.csv", "frame,id,x_mm,y_mm,z_mm,radius_mm,parent\n" + first + ",0,1,2,3,,-1\n" + second + ",1,1,2,4,,0\n"));
  };
  EXPECT_EQ(read("RAS", "RAS").points().col(1), Eigen::Vector3d(-1, -2, 4) / 1e3);
  EXPECT_EQ(read("LPS", "LPS").points().col(1), Eigen::Vector3d(1, 2, 4) / 1e3);
  EXPECT_NE(refusalOf([&] { read("RAS", "LPS"); }).find("t.csv:3: frame = LPS: must be RAS, as in the rows before"),
            std::string::npos);
  EXPECT_NE(refusalOf([&] { read("LAS", "LAS"); }).find("t.csv:2: frame = LAS: must be LPS or RAS"), std::string::npos);
}

struct DecimalComma : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST(VesselFiles, LocaleOfTheProgramChangesNothing) {
  const TemporaryFolder folder;
  const std::string text = "x_px,y_px\n1234.5,2.5\n";
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new DecimalComma));
  Centerline2d line = readCenterline(folder.write("c.csv", text));
  line.tangent_rad.resize(0);
  writeCenterline(folder.path("d.csv"), line);
  std::locale::global(before);
  EXPECT_EQ(line.points_px(0, 0), 1234.5);
  EXPECT_EQ(test::contentOf(folder.path("d.csv")), text);
}

TEST(CenterlineFiles, RoundTripKeepsEveryNumber) {
  const TemporaryFolder folder;
  Eigen::Matrix2Xd points_px(2, 5);
  points_px << 1.1, 2.2, 3.3, 100, 101, 5, 5.5, 6.125, 1.0 / 3, 0;
  Centerline2d line = makeCenterline(points_px, {7, 7, 7, 2, 2}, Eigen::VectorXd::LinSpaced(5, 1, 2));
  line.tangent_rad[1] = 0.125;  // Not what would be estimated: the file's own must come back.
  line.std_px = Eigen::VectorXd::LinSpaced(5, 0.1, 0.7);
  line.contrast = Eigen::VectorXd::LinSpaced(5, -0.1, 0.3);
  line.kind = {CurveKind::kVessel, CurveKind::kVessel, CurveKind::kVessel, CurveKind::kDevice, CurveKind::kDevice};
  writeCenterline(folder.path("c.csv"), line);
  const Centerline2d back = readCenterline(folder.path("c.csv"));
  EXPECT_EQ(back.points_px, line.points_px);
  EXPECT_EQ(back.branch, line.branch);
  EXPECT_EQ(back.tangent_rad, line.tangent_rad);
  EXPECT_EQ(back.radius_px, line.radius_px);
  EXPECT_EQ(back.std_px, line.std_px);
  EXPECT_EQ(back.contrast, line.contrast);
  EXPECT_EQ(back.kind, line.kind);
}

TEST(CenterlineFiles, ColumnsInAnyOrderAndBranchesBroughtTogether) {
  const TemporaryFolder folder;
  const Centerline2d line =
      readCenterline(folder.write("c.csv", "branch,y_px,x_px\n4,10,1\n1,20,5\n4,10,2\n1,21,5\n4,10,3"));
  EXPECT_EQ(line.branch, (std::vector<int>{4, 4, 4, 1, 1}));
  EXPECT_EQ(line.points_px.row(0), Eigen::RowVectorXd(Eigen::Matrix<double, 1, 5>(1, 2, 3, 5, 5)));
  EXPECT_NEAR(line.tangent_rad[0], 0, 1e-12);
  EXPECT_NEAR(std::abs(line.tangent_rad[3]), kPi / 2, 1e-12);
}

TEST(CenterlineFiles, OnePointIsEnough) {
  const TemporaryFolder folder;
  EXPECT_EQ(readCenterline(folder.write("c.csv", "x_px,y_px\n3,4\n")).size(), 1);
}

}  // namespace
}  // namespace angio::test

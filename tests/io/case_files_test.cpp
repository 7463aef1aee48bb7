// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/case_files.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "angio/io/centerline_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

TEST(CaseFiles, ReadsClinicalExample) {
  const CaseSet set = readCaseSet(test::exampleData("hepatic-tace/cases.yaml"));
  EXPECT_TRUE(set.sequence);
  ASSERT_EQ(set.cases.size(), 37U);
  EXPECT_EQ(set.cases[3].name, "0003");
  EXPECT_EQ(set.cases[3].views.at(0).camera.width_px(), 1024);
  EXPECT_DOUBLE_EQ(set.cases[3].initial_pose.translation().z(), 0.810);
  EXPECT_FALSE(set.cases[3].truth_pose);
  EXPECT_FALSE(set.cases[3].views[0].image_path);
  for (const Case& one : set.cases) EXPECT_GT(readCenterline(*one.views[0].centerline_path).size(), 1) << one.name;
}

struct CaseFolder : TemporaryFolder {
  CaseFolder() {
    for (const char* name : {"tree.csv", "other.csv", "line.csv", "image.png", "moves.csv"}) write(name, "");
    write("camera.yaml", camera(1000));
    write("zoom.yaml", camera(2000));
    write("p.yaml", pose(700));
    write("q.yaml", pose(800));
    write("bad.yaml", "rotation: [1]\n");
  }
  static std::string camera(int f) {
    const std::string focal = std::to_string(f);
    return "{image_size_px: [64, 64], fx_px: " + focal + ", fy_px: " + focal + ", cx_px: 32, cy_px: 32}\n";
  }
  static std::string pose(int z) {
    return "{rotation: [1,0,0,0,1,0,0,0,1], translation_mm: [0, 0, " + std::to_string(z) + "]}\n";
  }
};

TEST(CaseFiles, CaseMayBringItsOwnTreeAndCamera) {
  const CaseFolder folder;
  const CaseSet set = readCaseSet(folder.write("cases.yaml", R"(tree: tree.csv
camera: [camera.yaml]
cases:
  - {name: 0001, centerline: line.csv, initial_pose: p.yaml}
  - name: b
    tree: other.csv
    camera: zoom.yaml
    image: [image.png]
    initial_pose: p.yaml
    truth_pose: q.yaml
    truth_displacements: moves.csv
)"));
  EXPECT_FALSE(set.sequence);
  EXPECT_EQ(set.cases[0].name, "0001");
  EXPECT_EQ(set.cases[0].tree_path, folder.path("tree.csv"));
  EXPECT_EQ(set.cases[0].views[0].camera.parameters().fx_px, 1000);
  const Case& b = set.cases[1];
  EXPECT_EQ(b.tree_path, folder.path("other.csv"));
  EXPECT_EQ(b.views[0].camera.parameters().fx_px, 2000);
  EXPECT_EQ(b.views[0].image_path, folder.path("image.png"));
  EXPECT_DOUBLE_EQ(b.initial_pose.translation().z(), 0.7);
  EXPECT_DOUBLE_EQ(b.truth_pose->translation().z(), 0.8);
  EXPECT_EQ(b.truth_displacements_path, folder.path("moves.csv"));
}

// A tree whose file says its axes is read as L, P, S; another is read as it stands.
TEST(CaseFiles, PosesOfTreesThatSayRasAreTurned) {
  const CaseFolder folder;
  folder.write("curves.mrk.json", "");
  folder.write("tree.csv", "id,x_mm,y_mm,z_mm,radius_mm,parent\n0,1,2,3,,-1\n1,1,2,4,,0\n");
  folder.write("other.csv", "id,x_mm,y_mm,z_mm,radius_mm,parent,frame\n0,1,2,3,,-1,RAS\n1,1,2,4,,0,RAS\n");
  const auto read = [&](const std::string& of_set, const std::string& of_case, const std::string& more = "") {
    const std::string text = of_set +
                             "camera: camera.yaml\ncases:\n  - {name: a, centerline: line.csv, initial_pose: p.yaml, "
                             "truth_pose: q.yaml" +
                             of_case + more + "}\n";
    return readCaseSet(folder.write("cases.yaml", text)).cases.front();
  };
  const Case plain = read("tree: tree.csv\nframe: RAS\n", "");
  EXPECT_TRUE(plain.initial_pose.linear().isIdentity(1e-12));
  const Case lps = read("tree: curves.mrk.json\nframe: LPS\n", "");
  EXPECT_TRUE(lps.initial_pose.linear().isIdentity(1e-12));
  EXPECT_TRUE(read("tree: curves.mrk.json\nframe: RAS\n", ", frame: LPS").truth_pose->linear().isIdentity(1e-12));
  for (const Case& ras : {read("tree: curves.mrk.json\nframe: RAS\n", ""), read("tree: other.csv\nframe: RAS\n", ""),
                          read("tree: tree.csv\n", ", tree: curves.mrk.json, frame: RAS")}) {
    // The point (1, 2, 3) in R, A, S is (-1, -2, 3) in L, P, S.
    EXPECT_LT((ras.initial_pose * Eigen::Vector3d(-1, -2, 3) - Eigen::Vector3d(1, 2, 3.7)).norm(), 1e-12);
    EXPECT_LT((*ras.truth_pose * Eigen::Vector3d(-1, -2, 3) - Eigen::Vector3d(1, 2, 3.8)).norm(), 1e-12);
  }
  EXPECT_NE(refusalOf([&] { read("tree: tree.csv\nframe: LAS\n", ""); }).find("frame = LAS: must be LPS or RAS"),
            std::string::npos);
  const std::string moved = ", truth_displacements: moves.csv";
  EXPECT_NE(refusalOf([&] { read("tree: curves.mrk.json\nframe: RAS\n", "", moved); }).find("frame = RAS: must be LPS"),
            std::string::npos);
}

std::string turned() {  // By 90 deg about y; the frames' names are the writer's business.
  return "{rotation: [0,0,1,0,1,0,-1,0,0], translation_mm: [-750, 0, 750], parent: lateral, child: frontal}\n";
}

TEST(CaseFiles, SeveralViewsAreLists) {
  const CaseFolder folder;
  folder.write("turned.yaml", turned());
  folder.write("same.yaml", "{rotation: [1,0,0,0,1,0,0,0,1], translation_mm: [0, 0, 0]}\n");
  const CaseSet set = readCaseSet(folder.write("cases.yaml", R"(tree: tree.csv
camera: [camera.yaml, zoom.yaml]
T_view_first: [turned.yaml]
cases:
  - {name: list, centerline: [line.csv, other.csv], image: [image.png, moves.csv], initial_pose: p.yaml}
  - {name: whole list, T_view_first: [same.yaml, q.yaml], centerline: [line.csv, other.csv], initial_pose: p.yaml}
  - name: maps
    camera:
      - {camera: zoom.yaml, collimator_px: [[1, 2], [60, 2], [60, 50], [1, 50]]}
      - {camera: camera.yaml, T_view_first: turned.yaml}
    centerline: [line.csv, other.csv]
    initial_pose: p.yaml
  - {name: one, camera: zoom.yaml, centerline: line.csv, initial_pose: p.yaml}
)"));
  const auto& list = set.cases[0].views;
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[1].camera.parameters().fx_px, 2000);
  EXPECT_EQ(list[1].centerline_path, folder.path("other.csv"));
  EXPECT_EQ(list[1].image_path, folder.path("moves.csv"));
  EXPECT_EQ(list[0].T_view_first.matrix(), Pose::Identity().matrix());
  EXPECT_NEAR((list[1].T_view_first * Eigen::Vector3d(0, 0, 0.75) - Eigen::Vector3d(0, 0, 0.75)).norm(), 0, 1e-12);
  EXPECT_DOUBLE_EQ(set.cases[1].views.at(1).T_view_first.translation().z(), 0.8);
  const auto& maps = set.cases[2].views;
  EXPECT_EQ(maps.at(0).camera.parameters().fx_px, 2000);
  ASSERT_EQ(maps[0].collimator_px.size(), 4U);
  EXPECT_EQ(maps[0].collimator_px[2], Eigen::Vector2d(60, 50));
  EXPECT_EQ(maps.at(1).T_view_first.matrix(), list[1].T_view_first.matrix());
  EXPECT_TRUE(maps[1].collimator_px.empty());
  EXPECT_EQ(set.cases[3].views.size(), 1U);
}

TEST(CaseFiles, WhatIsWrittenReadsBackTheSame) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path("run"));
  const std::string tree = folder.write("run/tree.csv", ""), apart = folder.write("apart.csv", "");
  const std::string line = folder.write("run/line \"1\".csv", ""), image = folder.write("run/image.png", "");
  Pose side = Pose::Identity();
  side.linear() = expSO3({0.3, -1, 0.2});
  side.translation() << -0.7, 0.1, 0.6;
  const XrayCamera wide = XrayCamera::centered(640, 480, 0.3e-3, 1.1),
                   narrow = XrayCamera::centered(64, 48, 0.2e-3, 1.2);
  CaseSet set;
  set.sequence = true;
  set.frame_period_s = 0.25;
  set.cases.push_back({"0: first", tree, {{wide, line, image, Pose::Identity(), {}}}, side, {}, {}});
  set.cases.push_back(
      {"second",
       apart,
       {{wide, line, {}, Pose::Identity(), {{1, 2}, {60.5, 2}, {60, 50}}}, {narrow, line, {}, side, {}}},
       side.inverse(),
       side,
       apart});
  writeCaseSet(folder.path("run/cases.yaml"), set);

  const CaseSet back = readCaseSet(folder.path("run/cases.yaml"));
  EXPECT_TRUE(back.sequence);
  EXPECT_EQ(back.frame_period_s, 0.25);
  ASSERT_EQ(back.cases.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const Case &a = set.cases[i], &b = back.cases[i];
    EXPECT_EQ(b.name, a.name);
    EXPECT_EQ(b.tree_path, a.tree_path);
    EXPECT_EQ(b.truth_displacements_path, a.truth_displacements_path);
    // Rotations are made exact again when they are read.
    EXPECT_TRUE(b.initial_pose.isApprox(a.initial_pose, 1e-14));
    ASSERT_EQ(b.truth_pose.has_value(), a.truth_pose.has_value());
    if (a.truth_pose) {
      EXPECT_TRUE(b.truth_pose->isApprox(*a.truth_pose, 1e-14));
    }
    ASSERT_EQ(b.views.size(), a.views.size());
    for (std::size_t v = 0; v < a.views.size(); ++v) {
      EXPECT_EQ(b.views[v].centerline_path, a.views[v].centerline_path);
      EXPECT_EQ(b.views[v].image_path, a.views[v].image_path);
      EXPECT_EQ(b.views[v].camera.parameters().fx_px, a.views[v].camera.parameters().fx_px);
      EXPECT_EQ(b.views[v].camera.parameters().pixel_spacing_m, a.views[v].camera.parameters().pixel_spacing_m);
      EXPECT_EQ(b.views[v].collimator_px, a.views[v].collimator_px);
      EXPECT_TRUE(b.views[v].T_view_first.isApprox(a.views[v].T_view_first, 1e-14));
    }
  }

  set.cases[1].name = set.cases[0].name;
  EXPECT_NE(refusalOf([&] { writeCaseSet(folder.path("again.yaml"), set); }).find("must not be given twice"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder.path("again.yaml")));
}

TEST(CaseFiles, ViewsThatDoNotFitTogetherAreRefused) {
  const CaseFolder folder;
  folder.write("turned.yaml", turned());
  const std::string tree = "tree: tree.csv\n", two = tree + "camera: [camera.yaml, zoom.yaml]\n";
  const std::string cases = "cases:\n  - {name: a, centerline: [line.csv, line.csv], initial_pose: p.yaml}\n";
  const auto corners = [&](const std::string& list) {
    return tree + "camera: {camera: camera.yaml, collimator_px: " + list + "}\n" + cases;
  };
  const std::string not_convex = ":2: collimator_px = (list of ", rule = "): must be the corners of a convex polygon";
  const std::pair<std::string, std::string> sets[] = {
      {two + cases, ":2: T_view_first: is missing: where does camera[1] stand"},
      {two + "T_view_first: [turned.yaml, turned.yaml, turned.yaml]\n" + cases,
       ":3: T_view_first = (list of 3): must be a list of 2, one for each camera, or without the first"},
      {two + "T_view_first: [turned.yaml, turned.yaml]\n" + cases,
       ":3: T_view_first[0] = turned.yaml: must be the identity"},
      {two + "T_view_first: bad.yaml\n" + cases, ":3: " + folder.path("bad.yaml") + ":1: "},
      {two + "T_view_first: turned.yaml\ncases:\n  - {name: a, centerline: line.csv, initial_pose: p.yaml}\n",
       ":5: centerline = line.csv: must be a list of 2, one for each camera"},
      {two + "T_view_first: turned.yaml\ncases:\n  - {name: a, image: [line.csv], initial_pose: p.yaml}\n",
       ":5: image = (list of 1): must be a list of 2, one for each camera"},
      {tree + "camera: []\n" + cases, ":2: camera = (list of 0): must be at least one camera"},
      {tree + "camera: {camera: camera.yaml, colimator_px: []}\n" + cases,
       ":2: colimator_px = (list of 0): unknown key"},
      {corners("[[0, 0], [1, 1]]"), not_convex + "2" + rule},
      {corners("[[0, 0], [9, 0], [1, 1], [0, 9]]"), not_convex + "4" + rule},
      {corners("[[0, 0], [9, 0], [0, 9], [9, 9]]"), not_convex + "4" + rule},
      {corners("[[0, 0], [8, 6], [-2, 6], [6, 0], [3, 9]]"), not_convex + "5" + rule},  // A star winds twice.
      {corners("[[0, 0], [9, 0, 1], [0, 9]]"), ":2: collimator_px[1] = (list of 3): must be a list of 2 numbers"},
  };
  for (const auto& [content, expected] : sets) {
    const std::string path = folder.write("cases.yaml", content);
    const std::string message = refusalOf([&] { readCaseSet(path); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
    EXPECT_EQ(message.find(path), 0U) << message;
  }
}

TEST(CaseFiles, ErrorsNameTheCaseFilesLine) {
  const CaseFolder folder;
  const std::string head = "tree: tree.csv\ncamera: camera.yaml\ncases:\n";
  const std::string good = "  - {name: a, centerline: line.csv, initial_pose: p.yaml}\n";
  const std::pair<std::string, std::string> cases[] = {
      {"tree: none.csv\ncamera: camera.yaml\ncases:\n" + good,
       ":1: tree = " + folder.path("none.csv") + ": no such file"},
      {head + good + good, ":5: name = a: must not be given twice"},
      {head + "  - {name: a, centerline: line.csv}\n", ":4: initial_pose: is missing"},
      {head + "  - {centerline: line.csv, initial_pose: p.yaml}\n", ":4: name: is missing"},
      {head + "  - {name: a, initial_pose: p.yaml}\n", ":4: centerline or image: is missing"},
      {head + "  - name: a\n    centerline: [line.csv, line.csv]\n    initial_pose: p.yaml\n",
       ":5: centerline = (list of 2): must be one: there is one camera"},
      {head + "  - name: a\n    centerline: line.csv\n    initial_pose: bad.yaml\n",
       "bad.yaml:1: rotation = (list of 1)"},
      {head + "  - name: a\n    centerline: line.csv\n    initial_pose: bad.yaml\n", "cases.yaml:6: "},
      {head + "  - name: a\n    centerline: .\n    initial_pose: p.yaml\n", "is not a file"},
      {head + "  - {name: a, centreline: line.csv, initial_pose: p.yaml}\n", ":4: centreline = line.csv: unknown key"},
      {"cameras: camera.yaml\n" + head + good, ":1: cameras = camera.yaml: unknown key"},
      {"camera: camera.yaml\ncases:\n" + good, ":3: tree: is missing"},
      {head, ": cases = (nothing): must be a list of at least one case"},
      {"sequence: maybe\n" + head + good, ":1: sequence = maybe: must be true or false"},
      {"frame_period_s: 0\n" + head + good, ":1: frame_period_s = 0: must lie between 0.001 and 3600"},
      {"", ":1: cases: is missing"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string path = folder.write("cases.yaml", content);
    const std::string message = refusalOf([&] { readCaseSet(path); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
    EXPECT_EQ(message.find(path), 0U) << message;
  }
}

}  // namespace
}  // namespace angio::test

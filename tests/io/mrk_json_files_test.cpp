// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <random>

#include "angio/io/vessel_files.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using test::refusalOf;
using test::TemporaryFolder;

std::string point(const std::string& position) {
  return R"({"id":"1","position":[)" + position + R"(],"selected":true})";
}

std::string curve(const std::string& points, const std::string& more = R"("coordinateSystem":"LPS",)") {
  return R"({"type":"Curve",)" + more + R"("controlPoints":[)" + points + "]}";
}

std::string markups(const std::string& curves) { return "{\"@schema\":\"x\",\n\"markups\":[" + curves + "]}\n"; }

const std::string kTrunk = point("0,0,0") + "," + point("10,0,0") + "," + point("20,0,0");
const std::string kBranch = point("20,5,0") + "," + point("10,5,0") + "," + point("10,0,0");  // Ends at the trunk.

TEST(MrkJsonFiles, CurvesAreJoinedInAnyDirection) {
  const TemporaryFolder folder;
  const VesselTree tree = readVesselTree(folder.write("t.mrk.json", markups(curve(kTrunk) + "," + curve(kBranch))));
  EXPECT_EQ(tree.parents(), (std::vector<int>{-1, 0, 1, 1, 3}));
  EXPECT_EQ(tree.points().col(4), Eigen::Vector3d(0.020, 0.005, 0));
  EXPECT_FALSE(tree.radii()[0]);
}

TEST(MrkJsonFiles, CurvesThatSayRasAreTurned) {
  const TemporaryFolder folder;
  const std::string ras = R"("coordinateSystem":"RAS","coordinateUnits":"mm",)";
  const std::string radii =
      R"("measurements":[{"name":"length","value":3},{"name":"Radius","controlPointValues":[1.5,0,2.5]}],)";
  const VesselTree tree = readVesselTree(folder.write(
      "t.mrk.json", markups(curve(point("1,2,3") + "," + point("0,5,6") + "," + point("7,8,9"), ras + radii))));
  EXPECT_EQ(tree.points().col(0), Eigen::Vector3d(-0.001, -0.002, 0.003));
  EXPECT_DOUBLE_EQ(*tree.radii()[0], 0.0015);
  EXPECT_FALSE(tree.radii()[1]);
  EXPECT_DOUBLE_EQ(*tree.radii()[2], 0.0025);
}

TEST(MrkJsonFiles, ErrorsNameFieldAndRule) {
  const TemporaryFolder folder;
  const std::pair<std::string, std::string> cases[] = {
      {"", ":1: is not valid JSON"},
      {"{\"markups\":\n[1,]}", ":2: is not valid JSON"},
      {"{\"a\": 1e999}", "is not valid JSON"},
      {"[]", "markups: is missing"},
      {markups(""), "markups: must hold at least one curve"},
      {markups("7"), "markups[0].type: is missing"},
      {markups(R"({"type":"ClosedCurve"})"), "markups[0].type = ClosedCurve: must be Curve"},
      {markups(R"({"type":"Curve"})"), "markups[0].controlPoints: is missing"},
      {markups(curve(kTrunk, R"("coordinateSystem":"LAS",)")), "markups[0].coordinateSystem = LAS: must be LPS or RAS"},
      {markups(curve(kTrunk, R"("coordinateSystem":0,)")),
       "markups[0].coordinateSystem = number: must be of another type"},
      {markups(curve(kTrunk, R"("coordinateUnits":"um",)")), "markups[0].coordinateUnits = um: must be mm"},
      {markups(curve(point("0,0,0"))), "markups[0].controlPoints = 1: a curve must have at least 2"},
      {markups(curve(kTrunk + "," + point("1,2"))), "markups[0].controlPoints[3].position = 2: must be 3 numbers"},
      {markups(curve(kTrunk + "," + point("1,2,null"))), "controlPoints[3].position[2] = null: must be a number"},
      {markups(curve(kTrunk + "," + point("1,2,1e5"))), "controlPoints[3].position[2] = 100000: must lie between"},
      {markups(curve(kTrunk + "," + point("10,0,0"))), "markups[0]: the tree must not have a loop: control point 3"},
      {markups(curve(kTrunk) + "," + curve(point("0,0,0") + "," + point("5,5,0") + "," + point("20,0,0"))),
       "markups[1]: the tree must not have a loop: both ends"},
      {markups(curve(kTrunk, R"("measurements":[{"name":"Radius","controlPointValues":[1]}],)")),
       "measurements.controlPointValues = 1: must be as many as control points, 3"},
      {markups(curve(kTrunk, R"("measurements":[{"name":"Radius","controlPointValues":[1,"2",3]}],)")),
       "measurements.controlPointValues[1] = string: must be a number"},
      {std::string(100000, '['), "is not valid JSON"},
  };
  for (const auto& [content, expected] : cases) {
    const std::string path = folder.write("t.mrk.json", content);
    const std::string message = refusalOf([&] { readVesselTree(path); });
    EXPECT_NE(message.find(expected), std::string::npos) << message << "\nexpected: " << expected;
    EXPECT_EQ(message.find(path), 0U) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  EXPECT_NE(
      refusalOf([&] { readVesselTree(folder.write("t.json", markups(curve(kTrunk)))); }).find("extension = .json"),
      std::string::npos);
}

TEST(MrkJsonFiles, CutOrChangedFilesAreReadOrRefused) {
  const TemporaryFolder folder;
  const std::string good = markups(curve(kTrunk) + "," + curve(kBranch));
  std::mt19937 random(3);
  int refused = 0;
  const auto tryTo = [&](const std::string& content) {
    try {
      readVesselTree(folder.write("t.mrk.json", content));
    } catch (const InputError&) {
      ++refused;
    }
  };
  for (std::size_t length = 0; length + 2 < good.size(); ++length) tryTo(good.substr(0, length));
  for (int trial = 0; trial < 2000; ++trial) {
    std::string bad = good;
    for (int change = 0; change <= trial % 3; ++change) bad[random() % bad.size()] = static_cast<char>(random());
    tryTo(bad);
  }
  EXPECT_GT(refused, static_cast<int>(good.size()));
}

}  // namespace
}  // namespace angio::test

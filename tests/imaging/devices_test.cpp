// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>

#include "angio/imaging/extractor.hpp"
#include "angio/test/namespace.hpp"
#include "border_path.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

using test::clinicalScene;
using test::Scene;
using test::Vessel;

Centerline2d extractRidges(const Scene& scene) { return makeExtractor(RidgeSettings{})->extract(test::render(scene)); }

// Absorptions of vessels behind each other add.
void addDense(Scene& scene, const Vessel& vessel, int times) {
  for (int k = 0; k < times; ++k) scene.vessels.push_back(vessel);
}

// Parts of what is found on and off the lines of a scene's devices that is a device.
struct Told {
  double of_devices = 0, of_others = 0;
};

Told told(const Centerline2d& found, const std::vector<Vessel>& devices) {
  Scene lines;
  lines.vessels = devices;
  int on = 0, off = 0, right = 0, wrong = 0;
  for (int i = 0; i < found.size(); ++i) {
    const bool device = found.kind[i] == CurveKind::kDevice;
    const bool is_one = test::distanceToLines(lines, found.points_px.col(i)) < 3;
    (is_one ? on : off) += 1;
    (is_one ? right : wrong) += device ? 1 : 0;
  }
  return {static_cast<double>(right) / std::max(1, on), static_cast<double>(wrong) / std::max(1, off)};
}

// Guidewires of 0.36 mm at 5 px a millimetre; steel absorbs as much as seven times the scene's contrast agent.
const std::vector<Vessel> kWires = {{test::straightTube({60, 120}, {230, 160}, 0.9)},
                                    {test::arcTube({160, 360}, 90, 0.3, 2.6, 0.9)},
                                    {test::arcTube({400, 130}, 70, 2.0, 4.6, 0.9)},
                                    {test::straightTube({330, 420}, {470, 300}, 0.9)}};
constexpr int kSteel = 7;

TEST(Devices, DenseCatheterFromTheBorderIsADeviceAndTheTreeIsNot) {
  Scene scene = clinicalScene({test::randomTree(2, 1024, 1024)});
  const Vessel catheter{test::arcTube({-100, 1100}, 600, -1.45, -0.1, 5)};
  addDense(scene, catheter, 2);
  const Told what = told(extractRidges(scene), {catheter});
  EXPECT_GT(what.of_devices, 0.8);
  EXPECT_LT(what.of_others, 0.05);  // It goes on into the vessel that lies in line with its tip.
}

TEST(Devices, CatheterAloneOrNoDenserThanTheVesselsIsTakenForAVessel) {
  const Vessel catheter{test::arcTube({-100, 1100}, 600, -1.45, -0.1, 5)};
  Scene alone = clinicalScene({});
  addDense(alone, catheter, 2);
  EXPECT_EQ(ofKind(extractRidges(alone), CurveKind::kDevice).size(), 0);
  EXPECT_EQ(
      ofKind(extractRidges(clinicalScene({test::randomTree(2, 1024, 1024), catheter})), CurveKind::kDevice).size(), 0);
}

// What angiograms show: a catheter filled with the contrast agent that it gives, as dense as the vessels, whose tip
// lies where a wider vessel begins. A branch of the same width and way, whose parent goes on to both sides, is a
// vessel.
TEST(Devices, CatheterAsDenseAsItsVesselIsToldByItsWidthAndItsTip) {
  const auto line = test::straightTube({110, 0}, {150, 170}, 3.5);
  const Vessel vessel = {test::straightTube({150, 170}, {330, 300}, 6), test::straightTube({210, 213}, {370, 180}, 3),
                         test::straightTube({330, 300}, {450, 270}, 4), test::straightTube({330, 300}, {370, 450}, 4)};
  Vessel as_catheter = vessel, as_branch = vessel;
  as_catheter.push_back(line);
  as_branch.push_back(line);
  as_branch.push_back(test::straightTube({150, 170}, {30, 83}, 6));
  Scene scene;
  scene.vessels = {as_catheter};
  const Told what = told(extractRidges(scene), {{line}});
  EXPECT_GT(what.of_devices, 0.8);
  EXPECT_LT(what.of_others, 0.05);
  scene.vessels = {as_branch};
  EXPECT_EQ(ofKind(extractRidges(scene), CurveKind::kDevice).size(), 0);
}

// A catheter as wide as its vessel, a little denser, which ends where its vessel bends. What crosses it is no branch;
// an artery of that way and length widens on its way in, and a branch ends at the side of what goes on.
TEST(Devices, LongEvenLineFromTheBorderIsACatheterAndAWideningOneIsAnArtery) {
  const Eigen::Vector2d border(110, 0), tip(200, 190), way = tip - border;
  const Vessel tree = {test::straightTube({250, 220}, {330, 300}, 4), test::straightTube({330, 300}, {450, 270}, 4),
                       test::straightTube({330, 300}, {400, 440}, 4)};
  const auto line = test::straightTube(border, tip, 4);
  Scene scene;
  scene.vessels = {tree, {line}, {test::straightTube(border, tip, 1.6)}};
  for (const bool crossed : {false, true}) {
    if (crossed) scene.vessels.push_back({test::straightTube({80, 120}, {230, 70}, 2)});
    const Told what = told(extractRidges(scene), {{line}});
    EXPECT_GT(what.of_devices, 0.8) << crossed;
    EXPECT_LT(what.of_others, 0.1) << crossed;
  }
  Vessel artery = tree;
  for (int piece = 0; piece < 6; ++piece) {
    artery.push_back(
        test::straightTube(border + piece / 6.0 * way, border + (piece + 1) / 6.0 * way, 3.4 + 0.2 * piece));
  }
  scene.vessels = {artery};
  EXPECT_EQ(ofKind(extractRidges(scene), CurveKind::kDevice).size(), 0);
  scene.vessels = {{test::straightTube({60, 120}, {340, 260}, 4)}, {line}};
  EXPECT_EQ(ofKind(extractRidges(scene), CurveKind::kDevice).size(), 0);
}

// Over the heart, which scatters more, a catheter's contrast is half of what it is beside it. It goes on there, to
// where a wider vessel begins, and no farther.
TEST(Devices, CatheterGoesOnWhereItsContrastFalls) {
  const Eigen::Vector2d border(110, 0), heart(150, 160), tip(190, 320);
  const Vessel tree = {test::straightTube(tip, {330, 400}, 6), test::straightTube({330, 400}, {450, 370}, 4),
                       test::straightTube({330, 400}, {400, 500}, 4), test::straightTube({300, 80}, {460, 200}, 4),
                       test::straightTube({320, 250}, {480, 300}, 4)};
  const auto beside = test::straightTube(border, heart, 3.5), over = test::straightTube(heart, tip, 3.5);
  Scene scene;
  scene.vessels = {tree, {over}};
  addDense(scene, {beside}, 2);
  const Told what = told(extractRidges(scene), {{beside}, {over}});
  EXPECT_GT(what.of_devices, 0.9);
  EXPECT_LT(what.of_others, 0.02);
}

// An artery of the neck: from the border to where a wider one begins, as even as a catheter and wider than any.
TEST(Devices, AnArteryWiderThanCathetersAreIsAVessel) {
  for (const double radius : {3.5, 5.5}) {
    Scene scene;
    scene.vessels = {{test::straightTube({110, 0}, {150, 170}, radius),
                      test::straightTube({150, 170}, {330, 300}, 1.7 * radius),
                      test::straightTube({330, 300}, {450, 270}, 4), test::straightTube({330, 300}, {370, 450}, 4)}};
    EXPECT_EQ(ofKind(extractRidges(scene), CurveKind::kDevice).size() > 0, radius < 4) << radius;
  }
}

// A catheter's line that first follows what lies along the border begins where it turns away from that, by 45 deg; a
// line that turns by 25 deg there is a catheter from its first point on.
TEST(Devices, APathBeginsWhereItLeavesWhatLiesAlongTheBorder) {
  const std::vector<RowRange> open(512, {0, 512});
  constexpr std::size_t kTurn = 36, kSize = 120;
  for (const float turn_deg : {25.0f, 45.0f}) {
    CentreLine line;
    cv::Point2f at(8, 100);
    for (std::size_t i = 0; i < kSize; ++i) {
      line.line.push_back(at);
      const float angle = i < kTurn ? 0 : turn_deg * static_cast<float>(CV_PI) / 180;
      at += cv::Point2f(std::sin(angle), std::cos(angle));
    }
    line.radius.assign(kSize, 3.5f);
    line.sigma.assign(kSize, 0.3f);
    line.contrast.assign(kSize, 0.3f);
    const imaging::BorderPath path = imaging::pathFromBorder({line}, 0, open);
    ASSERT_EQ(path.pieces.size(), 1U);
    EXPECT_EQ(path.bend, kSize);
    EXPECT_NEAR(static_cast<double>(path.begin), turn_deg > 40 ? kTurn : 0, 5) << turn_deg;
  }
}

// A field of view inside of a tree: vessels of even width from border to border, without branches.
TEST(Devices, VesselsThatCrossTheFieldOfViewStayVessels) {
  Scene scene;
  scene.vessels = {{test::straightTube({0, 100}, {511, 180}, 3.5)},
                   {test::straightTube({150, 0}, {220, 511}, 3)},
                   {test::arcTube({520, 520}, 330, 3.17, 4.68, 4)},
                   {test::straightTube({0, 430}, {300, 511}, 2.5)}};
  const Centerline2d found = extractRidges(scene);
  EXPECT_GT(test::coverage(scene, found, 1.5), 0.9);
  EXPECT_EQ(ofKind(found, CurveKind::kDevice).size(), 0);
}

TEST(Devices, WiresInsideTheImageAreDevicesAndTheTreeIsNot) {
  for (const unsigned seed : {2u, 5u}) {
    Scene scene;
    scene.vessels = {test::randomTree(seed, 512, 512)};
    for (const Vessel& wire : kWires) addDense(scene, wire, kSteel);
    const Told what = told(extractRidges(scene), kWires);
    EXPECT_GT(what.of_devices, 0.7) << seed;  // One of the four may be joined to a vessel that it ends at.
    EXPECT_LT(what.of_others, 0.02) << seed;
  }
}

// More wire than vessel: what is usual in the image is steel, and the vessels are no bones beside it.
TEST(Devices, VesselsAmongManyWiresAreNotTakenForBones) {
  Scene vessels;
  vessels.vessels = {{test::straightTube({40, 260}, {470, 235}, 3.5)}, {test::straightTube({280, 30}, {300, 480}, 3)}};
  Scene scene = vessels;
  for (const Vessel& wire : kWires) addDense(scene, wire, kSteel);
  const Centerline2d found = extractRidges(scene);
  EXPECT_GT(test::coverage(vessels, ofKind(found, CurveKind::kVessel), 1.5), 0.95);
  EXPECT_GT(told(found, kWires).of_devices, 0.9);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/device_history.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "angio/test/namespace.hpp"
#include "contrast_arrival.hpp"
#include "line_metrics.hpp"

namespace angio::test {
namespace {

Tube movedBy(Tube tube, const Eigen::Vector2d& by) {
  for (Eigen::Vector2d& p : tube.line) p += by;
  return tube;
}

Vessel movedBy(Vessel vessel, const Eigen::Vector2d& by) {
  for (Tube& tube : vessel) tube = movedBy(tube, by);
  return vessel;
}

// Parts of what is found on and off a device's line that is a device, and of the line what has one.
struct Named {
  double on = 0, off = 0, covered = 0;
};

Named named(const Centerline2d& found, const Vessel& device) {
  Scene line;
  line.vessels = {device};
  int on = 0, off = 0, right = 0, wrong = 0;
  for (int i = 0; i < found.size(); ++i) {
    const bool is_device = found.kind[i] == CurveKind::kDevice;
    const bool is_on = distanceToLines(line, found.points_px.col(i)) < 3;
    (is_on ? on : off) += 1;
    (is_on ? right : wrong) += is_device ? 1 : 0;
  }
  return {static_cast<double>(right) / std::max(1, on), static_cast<double>(wrong) / std::max(1, off),
          coverage(line, ofKind(found, CurveKind::kDevice), 2)};
}

const Tube kCatheter = arcTube({150, 380}, 110, -1.9, 0.6, 3);
const Vessel kTree = randomTree(2, 512, 512);

constexpr int kFramesBefore = 3;

// Frame by frame all moves on, by a few pixels. The catheter lies within the image, and absorbs what vessels do.
Vessel catheterIn(int frame) { return movedBy(Vessel{kCatheter}, {2.5 * frame, -4.0 * frame}); }

cv::Mat imageOf(int frame) {
  Scene scene;
  scene.seed = static_cast<unsigned>(frame);
  scene.vessels = {catheterIn(frame), catheterIn(frame)};
  if (frame >= kFramesBefore) scene.vessels.push_back(movedBy(kTree, {2.5 * frame, -4.0 * frame}));
  return render(scene);
}

TEST(DeviceHistory, WhatStoodBeforeContrastAgentArrivedIsADeviceWhereverItMoves) {
  const auto extractor = makeExtractor(RidgeSettings{});
  imaging::DeviceHistory history;
  std::vector<Centerline2d> before;
  Centerline2d alone, found;
  for (int frame = 0; frame < 6; ++frame) {
    alone = extractor->extract(imageOf(frame));
    found = history.named(alone, 512);
    if (!history.knowsVessels()) before.push_back(found);
    if (frame == kFramesBefore) {
      ASSERT_EQ(before.size(), kFramesBefore);
      const auto again = history.namedAgain(before, 512);
      for (int k = 0; k < kFramesBefore; ++k) {
        EXPECT_EQ(ofKind(before[k], CurveKind::kDevice).size(), 0) << k;
        EXPECT_GT(named(again[k], catheterIn(k)).covered, 0.9) << k;
      }
    }
  }
  EXPECT_LT(named(alone, catheterIn(5)).on, 0.1);  // One frame does not show it.
  EXPECT_GT(named(found, catheterIn(5)).covered, 0.9);
  EXPECT_GT(named(found, catheterIn(5)).on, 0.9);
  EXPECT_LT(named(found, catheterIn(5)).off, 0.02);
}

// The first frames show a tree that is half full: all of it is there before more comes.
TEST(DeviceHistory, ARunThatBeginsWhileVesselsFillNamesNone) {
  const auto run = makeRunExtractor(RidgeSettings{});
  for (int frame = 0; frame < 8; ++frame) {
    Scene scene;
    scene.seed = static_cast<unsigned>(frame);
    scene.absorption_per_px = frame < 3 ? 0.01 : 0.02;
    scene.vessels = {kTree};
    if (frame >= 3) scene.vessels.push_back(randomTree(5, 512, 512));
    EXPECT_EQ(ofKind(run->extract(render(scene)), CurveKind::kDevice).size(), 0) << frame;
  }
}

// A wire in a wide vessel: the line that is found then is the vessel's, and stays one.
TEST(DeviceHistory, AVesselThatFillsAroundADeviceStaysAndTheDeviceHasALineOfItsOwn) {
  const Tube wire = arcTube({150, 380}, 110, -1.9, 0.6, 1), vessel = arcTube({150, 380}, 110, -1.9, 0.9, 7);
  const auto run = makeRunExtractor(RidgeSettings{});
  Centerline2d found;
  Scene scene;
  for (int frame = 0; frame < 5; ++frame) {
    scene.vessels.assign(4, Vessel{wire});
    if (frame >= 3) scene.vessels.insert(scene.vessels.end(), {Vessel{vessel}, kTree});
    scene.seed = static_cast<unsigned>(frame);
    found = run->extract(render(scene));
  }
  scene.vessels = {Vessel{wire}};
  EXPECT_GT(coverage(scene, ofKind(found, CurveKind::kVessel), 3), 0.9);
  EXPECT_GT(coverage(scene, ofKind(found, CurveKind::kDevice), 2), 0.9);
}

// A catheter's end lies at its own side, as a branch's does.
TEST(DeviceHistory, ADeviceThatCrossesItselfIsNoTree) {
  const Vessel loop{straightTube({100, 300}, {360, 300}, 3), arcTube({170, 300}, 60, -2.6, 0, 3)};
  const auto run = makeRunExtractor(RidgeSettings{});
  Centerline2d found;
  for (int frame = 0; frame < 5; ++frame) {
    Scene scene;
    scene.seed = static_cast<unsigned>(frame);
    scene.vessels = {loop, loop};
    if (frame >= 3) scene.vessels.push_back(kTree);
    found = run->extract(render(scene));
  }
  EXPECT_GT(named(found, loop).covered, 0.9);
  EXPECT_LT(named(found, loop).off, 0.02);
}

// Vessels are full when the run begins, a rest of the contrast agent is in one of them at its end, and fades.
TEST(DeviceHistory, ARunThatBeginsWithFullVesselsIsNamedFromItsEnd) {
  const auto extractor = makeExtractor(RidgeSettings{});
  const Tube stained = arcTube({380, 420}, 90, -2.5, 0.4, 4);
  std::vector<Centerline2d> frames;
  imaging::DeviceHistory history;
  for (int frame = 0; frame < 7; ++frame) {
    Scene scene;
    scene.seed = static_cast<unsigned>(frame);
    scene.vessels = {catheterIn(frame), catheterIn(frame)};
    for (int i = 0; i < (frame < 3 ? 2 : 1); ++i) scene.vessels.push_back({stained});
    if (frame < 3) scene.vessels.push_back(movedBy(kTree, {2.5 * frame, -4.0 * frame}));
    frames.push_back(history.named(extractor->extract(render(scene)), 512));
  }
  EXPECT_FALSE(history.knowsVessels());
  frames = imaging::DeviceHistory::namedFromEnd(frames, 512);
  for (int frame = 0; frame < 7; ++frame) {
    EXPECT_GT(named(frames[frame], catheterIn(frame)).covered, 0.9) << frame;
    EXPECT_LT(named(frames[frame], catheterIn(frame)).off, 0.02) << frame;
  }
}

// Frames' amounts, each seen with branches or not, and whether contrast agent has arrived at the end.
bool arrives(const std::vector<double>& amounts, double branched_from) {
  imaging::ContrastArrival contrast;
  for (const double amount : amounts) contrast.add(amount, amount > branched_from, 512);
  return contrast.arrived();
}

TEST(ContrastArrival, IsAStepFromFramesThatShowLittleAndTheSame) {
  EXPECT_TRUE(arrives({50, 51, 49, 70, 140}, 60));
  EXPECT_TRUE(arrives({50, 51, 2, 49, 70, 140}, 60));   // Once nothing was found.
  EXPECT_TRUE(arrives({90, 51, 50, 50, 70, 140}, 60));  // It began with more.
  EXPECT_FALSE(arrives({50, 51, 49, 50, 52}, 60));
  EXPECT_FALSE(arrives({50, 140, 300}, 60));                        // One frame says nothing of the next.
  EXPECT_FALSE(arrives({200, 201, 200, 400, 600}, 60));             // All of them show a tree.
  EXPECT_FALSE(arrives({100, 107, 115, 123, 131, 140, 200}, 1e9));  // It rises evenly.
}

}  // namespace
}  // namespace angio::test

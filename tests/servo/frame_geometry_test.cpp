// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/frame_geometry.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "angio/servo/servo_loop.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

struct Said {
  std::string name;
  std::string words;  // Of the refusal; empty: it may be looked at.
  std::function<void(XrayCamera::Parameters&)> say;
};

void PrintTo(const Said& said, std::ostream* os) { *os << said.name; }

// What frames may wrongly, or rightly, say of a camera that has not changed.
std::vector<Said> cases() {
  std::vector<Said> all;
  const auto focal = [&](const std::string& name, double factor) {
    all.push_back({"fx_" + name, "contradicts", [=](auto& k) { k.fx_px *= factor, k.fy_px *= factor; }});
    all.push_back({"fx_alone_" + name, "contradicts", [=](auto& k) {
                     k.fx_px *= factor, k.fy_px *= factor;
                     k.pixel_spacing_m.reset(), k.source_detector_distance_m.reset();
                   }});
    all.push_back({"fy_" + name, "fy", [=](auto& k) { k.fy_px *= factor; }});
    all.push_back({"spacing_" + name, "contradicts", [=](auto& k) { *k.pixel_spacing_m *= factor; }});
    all.push_back({"distance_" + name, "contradicts", [=](auto& k) { *k.source_detector_distance_m *= factor; }});
    all.push_back({"spacing_and_fx_" + name, "pixel_spacing", [=](auto& k) {
                     *k.pixel_spacing_m *= factor;
                     k.fx_px /= factor, k.fy_px /= factor;
                   }});
  };
  focal("2_percent_more", 1.02), focal("2_percent_less", 0.98);
  focal("5_percent_more", 1.05), focal("5_percent_less", 0.95);
  focal("20_percent_more", 1.2), focal("20_percent_less", 0.8);
  all.push_back({"spacing_in_mm", "in millimetres?", [](auto& k) { *k.pixel_spacing_m *= 1e3; }});
  all.push_back({"distance_in_mm", "in millimetres?", [](auto& k) { *k.source_detector_distance_m *= 1e3; }});
  all.push_back({"both_in_mm", "in millimetres?", [](auto& k) {
                   *k.pixel_spacing_m *= 1e3;
                   *k.source_detector_distance_m *= 1e3;
                 }});
  for (const double off : {50.0, -50.0}) {
    const std::string sign = off > 0 ? "_more" : "_less";
    all.push_back({"principal_point_x" + sign, "principal point", [=](auto& k) { k.cx_px += off; }});
    all.push_back({"principal_point_y" + sign, "principal point", [=](auto& k) { k.cy_px += off; }});
  }
  all.push_back({"wider", "more than the calibration's detector", [](auto& k) { k.width_px += 64; }});
  all.push_back({"twice_the_size", "more than the calibration's detector", [](auto& k) {
                   k.width_px *= 2, k.height_px *= 2;
                   k.cx_px *= 2, k.cy_px *= 2;
                 }});
  all.push_back({"narrower_with_the_middle_of_the_whole", "", [](auto& k) { k.height_px -= 10; }});
  all.push_back({"right", "", [](auto&) {}});
  all.push_back(
      {"right_and_silent", "", [](auto& k) { k.pixel_spacing_m.reset(), k.source_detector_distance_m.reset(); }});
  all.push_back({"a_window", "", [](auto& k) {
                   k.width_px = 200, k.height_px = 160;
                   k.cx_px -= 90, k.cy_px -= 120;
                 }});
  all.push_back({"binned", "", [](auto& k) {
                   k.width_px /= 2, k.height_px /= 2;
                   k.fx_px /= 2, k.fy_px /= 2, *k.pixel_spacing_m *= 2;
                   k.cx_px = 0.5 * k.cx_px - 0.25, k.cy_px = 0.5 * k.cy_px - 0.25;
                 }});
  all.push_back({"detector_moved", "", [](auto& k) {
                   k.fx_px *= 1.1, k.fy_px *= 1.1;
                   *k.source_detector_distance_m *= 1.1;
                 }});
  return all;
}

class FrameGeometry : public testing::TestWithParam<Said> {};

TEST_P(FrameGeometry, IsHeldByNameOrRight) {
  test::Stage stage;
  XrayCamera::Parameters k = stage.settings.carm.camera().parameters();
  GetParam().say(k);
  const auto why = contradiction(XrayCamera(k), stage.settings.carm);
  EXPECT_EQ(why.value_or("").empty(), GetParam().words.empty()) << why.value_or("nothing is said against it");
  EXPECT_NE(why.value_or("").find(GetParam().words), std::string::npos) << why.value_or("");
  // And the loop does not look at it.
  if (GetParam().words.empty()) return;
  ServoLoop loop(stage.settings, stage.tree);
  XrayFrame frame = stage.frame(1);
  frame.camera = XrayCamera(k);
  frame.image = cv::Mat(k.height_px, k.width_px, CV_16UC1, cv::Scalar(30000));
  const ServoReport report = loop.step(frame, stage.state(1));
  EXPECT_EQ(report.hold_reason, why);
  EXPECT_FALSE(report.observed);
  EXPECT_TRUE(report.command.velocity.isZero(0));
}

INSTANTIATE_TEST_SUITE_P(All, FrameGeometry, testing::ValuesIn(cases()),
                         [](const auto& tested) { return tested.param.name; });

Eigen::Vector3d beam(double primary_deg, double secondary_deg) {
  return beamDirection({degToRad(primary_deg), degToRad(secondary_deg)});
}

// A patient who lies elsewhere, and depths that are 4 mm off from view to view: noise of the monitor's own model.
FocalLengthMonitor watching(double focal_error, const Eigen::Vector3d& offset, unsigned seed) {
  test::Random random(seed);
  FocalLengthMonitor monitor;
  for (int k = 0; k < 60; ++k) {
    const Eigen::Vector3d b = beam(random.uniform(-60, 60), random.uniform(-30, 30));
    monitor.see(b, b.dot(offset) + focal_error * 0.78 + 4e-3 * random.normal(), 0.78);
  }
  return monitor;
}

TEST(FocalLengthMonitor, NoticesAnErrorThatEveryViewShares) {
  int told = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    for (const double error : {0.04, -0.04}) {
      const FocalLengthMonitor monitor = watching(error, {8e-3, -6e-3, 5e-3}, seed);
      EXPECT_NEAR(monitor.estimate().error, error, 4 * monitor.estimate().std);
      told += monitor.warning().has_value();
    }
  }
  EXPECT_EQ(told, 40);
  EXPECT_NE(watching(0.04, Eigen::Vector3d::Zero(), 1).warning()->find("too long"), std::string::npos);
  EXPECT_NE(watching(-0.04, Eigen::Vector3d::Zero(), 1).warning()->find("too short"), std::string::npos);
}

TEST(FocalLengthMonitor, APatientWhoLiesElsewhereIsNone) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    test::Random random(seed);
    const FocalLengthMonitor monitor = watching(0, random.vector(12e-3), seed);
    EXPECT_FALSE(monitor.warning()) << *monitor.warning();
  }
  // One view cannot tell the two apart, however often it is seen.
  FocalLengthMonitor one;
  for (int k = 0; k < 1000; ++k) one.see(beam(10, 5), 25e-3, 0.78);
  EXPECT_FALSE(one.warning());
}

// Frames and calibration are wrong alike, so that nothing else can notice. Seen through it the tree seems deformed, and
// its depth is too unsure for the task: such frames count as well.
TEST(FocalLengthMonitor, IsToldByTheLoop) {
  test::Stage stage;
  ServoLoopSettings wrong = stage.settings;
  wrong.carm.source_detector_distance_m *= 1.04;
  ServoLoop loop(wrong, stage.tree), right(stage.settings, stage.tree);
  const Eigen::Vector3d centroid = stage.tree.centroid();
  std::int64_t sequence = 0;
  for (int k = 0; k < 64; ++k) {  // A walk over the views, 5 to 8 deg at a time.
    const double primary_deg = 55 * std::sin(0.1 * k), secondary_deg = 28 * std::sin(0.23 * k);
    stage.joints = stage.settings.carm.jointsFor({degToRad(primary_deg), degToRad(secondary_deg)}, centroid);
    XrayFrame frame = stage.frame(++sequence);
    right.step(frame, stage.state(sequence));
    frame.camera = wrong.carm.camera();
    loop.step(frame, stage.state(sequence));
  }
  ASSERT_TRUE(loop.focalLengthWarning());
  EXPECT_NE(loop.focalLengthWarning()->find("too long"), std::string::npos) << *loop.focalLengthWarning();
  EXPECT_FALSE(right.focalLengthWarning());
}

}  // namespace
}  // namespace angio::test

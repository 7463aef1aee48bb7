// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/device_score.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "angio/evaluation/extraction_run.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

struct Line {
  double x_px, y_px, length_px;
  CurveKind kind;
};

// Lines along x, of radius 3 px.
Centerline2d curveOf(const std::vector<Line>& lines) {
  std::vector<Eigen::Vector2d> points;
  std::vector<int> branch;
  std::vector<CurveKind> kind;
  for (std::size_t l = 0; l < lines.size(); ++l) {
    for (double x = 0; x <= lines[l].length_px; ++x) {
      points.emplace_back(lines[l].x_px + x, lines[l].y_px);
      branch.push_back(static_cast<int>(l));
      kind.push_back(lines[l].kind);
    }
  }
  Eigen::Matrix2Xd px(2, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) px.col(static_cast<Eigen::Index>(i)) = points[i];
  Centerline2d curve = makeCenterline(px, branch, Eigen::VectorXd::Constant(px.cols(), 3));
  curve.kind = kind;
  return curve;
}

constexpr CurveKind kVessel = CurveKind::kVessel, kDevice = CurveKind::kDevice;

TEST(DeviceScore, CountsWhatIsToldAndWhatIsTakenForTheOther) {
  const Centerline2d shown = curveOf({{0, 50, 99, kDevice}, {0, 100, 199, kVessel}});
  DeviceScore score;
  // Sixty of a hundred pixels of the device, half of the rest as a vessel; a twentieth of the vessel as a device, whose
  // first pixel and a half lie at the end of the vessel's line.
  score.add(curveOf({{0, 50, 59, kDevice}, {62, 51, 17, kVessel}, {0, 100, 189, kVessel}, {190, 100, 9, kDevice}}),
            shown, 1.5);
  EXPECT_EQ(score.asJson()["frames"], 1);
  EXPECT_EQ(score.asJson()["named"], 1);
  EXPECT_NEAR(score.asJson()["told"], 0.6, 0.02);
  EXPECT_NEAR(score.asJson()["taken_for_vessel"], 0.2, 0.03);
  EXPECT_NEAR(score.asJson()["vessels_called_device"], 0.05, 0.01);
  score.add(curveOf({{0, 50, 39, kDevice}}), shown, 1.5);
  EXPECT_EQ(score.asJson()["frames"], 2);
  EXPECT_EQ(score.asJson()["named"], 0.5);
}

TEST(DeviceScore, AFrameWithoutADeviceIsNoFrame) {
  DeviceScore score;
  score.add(curveOf({{0, 100, 199, kDevice}}), curveOf({{0, 100, 199, kVessel}, {0, 50, 30, kDevice}}), 1.5);
  EXPECT_FALSE(score.any());
}

// What lies along a device within its vessel is either's.
TEST(DeviceScore, AVesselThatHoldsADeviceIsNotCounted) {
  const Centerline2d shown = curveOf({{0, 100, 99, kDevice}, {0, 101, 99, kVessel}});
  DeviceScore score;
  score.add(curveOf({{0, 101, 99, kDevice}}), shown, 1.5);
  EXPECT_EQ(score.asJson()["told"], 1);
  EXPECT_EQ(score.asJson()["vessels_called_device"], 0);
}

// A vessel that has a line as well is not lost.
TEST(DeviceScore, ADeviceBesideItsVesselsLineIsNoVesselCalledADevice) {
  const Centerline2d shown = curveOf({{0, 50, 99, kDevice}, {0, 100, 199, kVessel}});
  DeviceScore score;
  score.add(curveOf({{0, 50, 99, kDevice}, {0, 100, 149, kVessel}, {0, 101, 199, kDevice}}), shown, 1.5);
  // Of 199 px of a device's line 49 stand where the vessel has none of its own.
  EXPECT_NEAR(score.asJson()["vessels_called_device"], 0.25, 0.02);
}

// The frames before it show the same patient: earlier, and at rest no more moved than by noise.
TEST(DeviceSamples, ARunLeadsToTheFrameThatStandsAlone) {
  SimulationSettings settings;
  settings.trials = 1;
  settings.model_axes = ModelAxes::kLip;
  const auto tree = readVesselTree(ANGIO_EXAMPLE_DATA "/hepatic-tace/tree.csv");
  DeviceRuns runs;
  const ExtractionSample alone = deviceSamples({tree}, {}, settings, runs).at(0);
  EXPECT_FALSE(alone.run);
  runs.frames_per_s = 8;
  const ExtractionSample last = deviceSamples({tree}, {}, settings, runs).at(0);
  ASSERT_TRUE(last.run);
  ASSERT_GT(last.run->index, 2);
  EXPECT_EQ(cv::countNonZero(last.image != alone.image), 0);
  const cv::Mat first = last.run->frame(0), next = last.run->frame(1);
  EXPECT_EQ(first.size(), alone.image.size());
  EXPECT_GT(cv::countNonZero(first != next), 0);
  EXPECT_LT(std::abs(cv::mean(first)[0] / cv::mean(next)[0] - 1), 0.05);
}

TEST(DeviceSamples, ShowADeviceWhereNoVesselHidesIt) {
  SimulationSettings settings;
  settings.trials = 4;
  settings.model_axes = ModelAxes::kLip;
  const auto tree = readVesselTree(ANGIO_EXAMPLE_DATA "/hepatic-tace/tree.csv");
  const auto samples = deviceSamples({tree}, {}, settings, {});
  int shown = 0, hidden = 0;
  for (int i = 0; i < samples.count; ++i) {
    const ExtractionSample sample = samples.at(i);
    EXPECT_EQ(sample.image.size(), cv::Size(1024, 1024));
    const auto all = ofKind(sample.allowed, kDevice).size();
    ASSERT_GT(all, 0);
    shown += ofKind(sample.shown, kDevice).size();
    hidden += all - ofKind(sample.shown, kDevice).size();
  }
  EXPECT_GT(shown, 100);
  EXPECT_GT(hidden, 100);
}

}  // namespace
}  // namespace angio::test

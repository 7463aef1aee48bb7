// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_lab.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

constexpr TreeLocation kStart{0, 0.02};

// A detector with 512 x 512 pixels whose beam's middle is the tree's, and a catheter if there is a start.
LabWorld worldOf(const VesselTree& tree, const std::optional<TreeLocation>& start) {
  LabWorld world;
  world.carm.image_width_px = world.carm.image_height_px = 512;
  world.carm.pixel_spacing_m *= 2;
  world.start = world.carm.jointsFor({}, tree.centroid());
  if (start) world.catheter = LabCatheter{{}, *start};
  return world;
}

struct SimulatedLabTest : testing::Test {
  SimulatedLabTest() {
    patient.bolus.enabled = true;
    patient.bolus.trigger = BolusTrigger::kDemand;
  }

  std::unique_ptr<SimulatedLab> labWith(const std::optional<TreeLocation>& start) const {
    return std::make_unique<SimulatedLab>(tree, patient, worldOf(tree, start), settings);
  }

  static Exposure nextExposure(SimulatedLab& lab) {
    for (;;) {
      if (auto exposure = lab.advance()) return *std::move(exposure);
    }
  }

  // Mean gray value at the pixels that show points of the model [m].
  static double meanAlong(const SimulatedLab& lab, const Exposure& exposure, const Eigen::Matrix3Xd& points) {
    double sum = 0;
    int count = 0;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      const auto pixel = exposure.frame.camera.project(lab.inCamera(points.col(i)));
      if (!pixel) continue;
      const cv::Point at(static_cast<int>(std::lround(pixel->x())), static_cast<int>(std::lround(pixel->y())));
      if (!cv::Rect({}, exposure.frame.image.size()).contains(at)) continue;
      sum += exposure.frame.image.at<std::uint16_t>(at);
      ++count;
    }
    EXPECT_GT(count, 10);
    return sum / count;
  }

  VesselTree tree = test::branchingTree(3);
  SimulatedPatientSettings patient;
  LabSettings settings;
};

TEST_F(SimulatedLabTest, ACommandMovesTheDriveAfterTheLatency) {
  settings.images = false;
  const auto lab = labWith(kStart);
  while (lab->now_us() < 500'000) lab->advance();
  const std::int64_t sent_us = lab->now_us(), arrives_us = sent_us + 80'000;
  CatheterCommand push;
  push.time_us = sent_us;
  push.sequence = 1;
  push.valid_for_us = 1'000'000;
  push.insertion_speed_m_per_s = 0.01;
  publish(lab->loopSide(), kCatheterCommandChannel, push);
  while (lab->now_us() < sent_us + 600'000) {
    lab->advance();
    const CatheterState state = lab->catheter().state();
    const double moved_s = 1e-6 * static_cast<double>(std::max<std::int64_t>(state.time_us - arrives_us, 0));
    ASSERT_NEAR(state.insertion_m, kStart.arc_m + 0.01 * moved_s, 1e-12) << state.time_us;
  }
  EXPECT_GT(lab->catheter().truth().path_m, kStart.arc_m + 2e-3);
}

TEST_F(SimulatedLabTest, BothMachinesReportAtTheExposureAndBetween) {
  const auto lab = labWith(kStart);
  const LatestMessage<CArmState> arm(lab->loopSide(), kCArmStateChannel);
  const LatestMessage<CatheterState> drive(lab->loopSide(), kCatheterStateChannel);
  const LatestMessage<XrayFrame> frames(lab->loopSide(), kXrayFrameChannel);
  std::vector<std::string> channels;
  lab->loopSide().subscribeAll(
      [&](const std::string& channel, const std::uint8_t*, std::size_t) { channels.push_back(channel); });
  int exposures = 0;
  while (exposures < 3) {
    channels.clear();
    const auto exposure = lab->advance();
    ASSERT_TRUE(drive.peek());
    EXPECT_EQ(drive.peek()->time_us, arm.peek()->time_us);
    EXPECT_EQ(drive.peek()->sequence, arm.peek()->sequence);
    if (!exposure) continue;
    ++exposures;
    EXPECT_EQ(drive.peek()->time_us, lab->now_us());
    EXPECT_EQ(frames.peek()->time_us, lab->now_us());
    EXPECT_EQ(channels, (std::vector<std::string>{kCArmStateChannel, kCatheterStateChannel, kXrayFrameChannel}));
    ASSERT_TRUE(exposure->catheter);
    EXPECT_EQ(exposure->catheter->path_m, kStart.arc_m);
  }
  EXPECT_GT(drive.peek()->sequence, exposures);
}

TEST_F(SimulatedLabTest, TheCatheterDarkensTheImageWhereItLies) {
  const auto with = labWith(kStart), without = labWith(std::nullopt);
  const Exposure seen = nextExposure(*with), bare = nextExposure(*without);
  EXPECT_FALSE(bare.catheter);
  EXPECT_THROW(without->catheter(), std::bad_optional_access);
  EXPECT_EQ(seen.frame.time_us, bare.frame.time_us);
  EXPECT_EQ(seen.state.joints, bare.state.joints);
  const Eigen::Matrix3Xd line = with->catheter().device(tree.points()).points;
  EXPECT_LT(meanAlong(*with, seen, line), 0.7 * meanAlong(*without, bare, line));
  // Scatter and noise differ everywhere, but the catheter covers a small part of the image: some 60 px by 3 px.
  EXPECT_NEAR(cv::mean(seen.frame.image)[0], cv::mean(bare.frame.image)[0], 1e-3 * cv::mean(bare.frame.image)[0]);
}

TEST_F(SimulatedLabTest, AnInjectionDarkensTheTreeUntilItHasWashedOut) {
  settings.frame_rate_hz = 1;
  const auto lab = labWith(std::nullopt);
  const auto meanOfTree = [&] {
    const Exposure exposure = nextExposure(*lab);
    return meanAlong(*lab, exposure, tree.points());
  };
  const double empty = meanOfTree();
  lab->beginInjection();
  lab->beginInjection();
  meanOfTree();
  EXPECT_LT(meanOfTree(), 0.9 * empty);
  lab->endInjection();
  lab->endInjection();
  for (int k = 0; k < 20; ++k) nextExposure(*lab);
  EXPECT_NEAR(meanOfTree(), empty, 0.02 * empty);
  lab->beginInjection();
  meanOfTree();
  EXPECT_LT(meanOfTree(), 0.9 * empty);
}

TEST_F(SimulatedLabTest, RefusesAStartThatIsNoPlaceOfTheTree) {
  EXPECT_NE(test::refusalOf([&] { labWith(TreeLocation{99, 0}); }).find("chain"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

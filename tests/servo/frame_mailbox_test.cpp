// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/frame_mailbox.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

struct FrameMailboxTest : testing::Test {
  void frame(std::int64_t sequence) {
    publish(*bus, kXrayFrameChannel,
            XrayFrame{100 * sequence, sequence, cv::Mat(8, 8, CV_16UC1, cv::Scalar(1)),
                      XrayCamera::centered(8, 8, 1e-3, 1)});
  }
  void registration(std::int64_t sequence, std::int64_t time_us, double residual_px = 0) {
    RegistrationMessage message;
    message.frame_sequence = sequence;
    message.time_us = time_us;
    message.mean_residual_px = residual_px;
    publish(*bus, kRegistrationChannel, message);
  }
  void tip(std::int64_t sequence) {
    CatheterTip message;
    message.frame_sequence = sequence;
    message.time_us = 100 * sequence;
    publish(*bus, kCatheterTipChannel, message);
  }
  // The number of the frame that is taken, or -1.
  std::int64_t taken(FrameMailbox& box) {
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
    last = box.take();
    return last ? last->frame.sequence : -1;
  }

  std::unique_ptr<Bus> bus = openBus("memq://");
  std::optional<FrameWithEstimates> last;
};

TEST_F(FrameMailboxTest, GivesTheNewestFrameWhereNothingIsToBeTold) {
  FrameMailbox box(*bus, {});
  frame(1);
  frame(2);
  registration(2, 200);
  EXPECT_EQ(taken(box), 2);
  EXPECT_FALSE(last->external.registration);
  EXPECT_EQ(taken(box), -1);
}

TEST_F(FrameMailboxTest, FramesWaitForWhatIsSaidOfThem) {
  FrameMailbox box(*bus, {true, true});
  for (const std::int64_t k : {1, 2, 3}) {
    frame(k);
    EXPECT_EQ(taken(box), -1);
  }
  registration(2, 200);
  EXPECT_EQ(taken(box), -1) << "the tip is missing";
  tip(1);
  EXPECT_EQ(taken(box), -1) << "of another frame";
  tip(2);
  EXPECT_EQ(taken(box), 2);
  EXPECT_EQ(last->external.registration->frame_sequence, 2);
  EXPECT_EQ(last->external.tip->frame_sequence, 2);
  registration(1, 100);
  EXPECT_EQ(taken(box), -1) << "it has been let go for a newer one";
  tip(3);
  registration(3, 300);
  EXPECT_EQ(taken(box), 3);
}

TEST_F(FrameMailboxTest, WhatIsSaidMayComeFirstAndTheFirstToSayItCounts) {
  FrameMailbox box(*bus, {true, false});
  registration(1, 100, 0.5);
  registration(1, 100, 7);
  EXPECT_EQ(taken(box), -1);
  frame(1);
  EXPECT_EQ(taken(box), 1);
  EXPECT_EQ(last->external.registration->mean_residual_px, 0.5);
}

TEST_F(FrameMailboxTest, ANumberWithAnotherTimeIsAnotherFrame) {
  FrameMailbox box(*bus, {true, false});
  frame(1);
  registration(1, 999);
  EXPECT_EQ(taken(box), -1);
}

TEST_F(FrameMailboxTest, KeepsNoMoreThanHalfASecond) {
  FrameMailbox box(*bus, {true, false});
  for (std::int64_t k = 1; k <= 20; ++k) {
    frame(k);
    EXPECT_EQ(taken(box), -1);
  }
  registration(12, 1200);
  EXPECT_EQ(taken(box), -1);
  registration(13, 1300);
  EXPECT_EQ(taken(box), 13);
}

}  // namespace
}  // namespace angio::test

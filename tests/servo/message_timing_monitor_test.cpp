// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/message_timing_monitor.hpp"
#include "angio/test/namespace.hpp"
#include "frame_period.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace angio::test {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kOtherClock_us = -3'000'000'000;

class Freshness : public testing::Test {
 protected:
  // A new frame with its own noise; its sender's clock is far from ours.
  XrayFrame frame(std::int64_t k) const {
    XrayFrame f{kOtherClock_us + k * kPeriod_us, k, cv::Mat(8, 8, CV_8UC1), XrayCamera::centered(8, 8, 1e-3, 1)};
    f.image.setTo(static_cast<double>(k % 251));
    return f;
  }
  CArmState state(std::int64_t k) const {
    CArmState s;
    s.time_us = kOtherClock_us + k * kPeriod_us;
    s.sequence = k;
    return s;
  }
  // What is said of frame k, `late_ms` after it was exposed; empty when nothing.
  std::string said(const XrayFrame& f, std::int64_t k, double late_ms = 20) {
    const auto o = gate_.rejection(f, k * kPeriod_us + std::llround(1e3 * late_ms));
    if (!o) return "";
    return o->cause == ServoCause::kFrameDoubted ? o->reason : std::string(nameOf(o->cause)) + ": " + o->reason;
  }
  std::string said(const CArmState& s, std::int64_t k, double late_ms = 1) {
    const auto o = gate_.rejection(s, k * kPeriod_us + std::llround(1e3 * late_ms));
    return o ? std::string(nameOf(o->cause)) + ": " + o->reason : "";
  }

  MessageTimingSettings settings_;
  CArmLimits limits_ = CArmLimits::typical();
  MessageTimingMonitor gate_{settings_, limits_};
};

TEST_F(Freshness, HasNothingAgainstASteadyStreamWithJitterAndGaps) {
  for (std::int64_t k = 1; k < 500; ++k) {
    if (k % 7 == 3) continue;
    EXPECT_EQ(said(state(k), k), "");
    EXPECT_EQ(said(frame(k), k, 20 + 15.0 * static_cast<double>(k % 13)), "") << k;
  }
}

TEST_F(Freshness, AFrameThatComesTwiceOrLateIsDoubted) {
  EXPECT_EQ(said(frame(1), 1), "");
  EXPECT_EQ(said(frame(3), 3), "");
  EXPECT_THAT(said(frame(3), 4), HasSubstr("twice or late"));
  EXPECT_THAT(said(frame(2), 4), HasSubstr("twice or late"));
  EXPECT_EQ(said(frame(4), 4), "");
}

TEST_F(Freshness, AFrameThatIsLaterThanTheQuickestIsDoubtedWhateverTheClocks) {
  for (std::int64_t k = 1; k < 10; ++k) EXPECT_EQ(said(frame(k), k), "");
  EXPECT_EQ(said(frame(10), 10, 20 + settings_.max_frame_age_ms), "");
  EXPECT_THAT(said(frame(11), 11, 25 + settings_.max_frame_age_ms), HasSubstr("later than the quickest"));
  EXPECT_EQ(said(frame(20), 20), "");
}

TEST_F(Freshness, AConstantDelayShowsAgainstTheJoints) {
  for (std::int64_t k = 1; k < 20; ++k) {
    EXPECT_EQ(said(state(k), k), "");
    if (k < 8) continue;
    EXPECT_THAT(said(frame(k - 7), k), HasSubstr("later than the newest joints")) << "467 ms behind, as all before it";
  }
}

TEST_F(Freshness, ANewNumberOnOldPixelsIsAFrozenImage) {
  EXPECT_EQ(said(frame(1), 1), "");
  XrayFrame frozen = frame(1);
  for (std::int64_t k = 2; k < 6; ++k) {
    frozen.sequence = k;
    frozen.time_us = kOtherClock_us + k * kPeriod_us;
    frozen.image = frozen.image.clone();
    EXPECT_THAT(said(frozen, k), HasSubstr("frozen"));
  }
  EXPECT_EQ(said(frame(6), 6), "");
}

TEST_F(Freshness, AClockThatJumpsIsAFaultOnce) {
  for (const double jump_ms : {-500.0, 5000.0}) {
    gate_.forget();
    EXPECT_EQ(said(frame(1), 1), "");
    XrayFrame f = frame(2);
    f.time_us += std::llround(1e3 * jump_ms);
    EXPECT_THAT(said(f, 2), HasSubstr("a clock jumped"));
    for (std::int64_t k = 3; k < 6; ++k) {
      f = frame(k);
      f.time_us += std::llround(1e3 * jump_ms);
      EXPECT_EQ(said(f, k), "") << "it goes on by the new clock";
    }
  }
  EXPECT_EQ(said(state(1), 10), "");
  CArmState back = state(2);
  back.time_us -= 1'000'000;
  EXPECT_THAT(said(back, 11), HasSubstr("a clock jumped"));
}

TEST_F(Freshness, ASenderThatBeginsAgainIsDoubtedOnce) {
  EXPECT_EQ(said(frame(100), 100), "");
  XrayFrame again = frame(130);
  again.sequence = 1;
  EXPECT_THAT(said(again, 130), HasSubstr("began again"));
  again = frame(131);
  again.sequence = 2;
  EXPECT_EQ(said(again, 131), "");
}

TEST_F(Freshness, AClockThatDriftsIsFollowed) {
  // 100 ppm for 4 hours are 1.4 s.
  for (std::int64_t k = 1; k < 4 * 3600 * 15; k += 15) {
    ASSERT_EQ(said(frame(k), k, 20 + 1e-4 * 66.667 * static_cast<double>(k)), "") << k;
  }
}

TEST_F(Freshness, JointsMustBeFiniteInRangeAndInTheirUnits) {
  const auto with = [&](int joint, double q, double v = 0) {
    gate_.forget();
    CArmState s = state(1);
    s.joints[joint] = q;
    s.velocity[joint] = v;
    return said(s, 1);
  };
  EXPECT_EQ(with(0, limits_.upper[0]), "");
  EXPECT_EQ(with(2, limits_.lower[2]), "");
  EXPECT_THAT(with(0, std::nan("")), HasSubstr("not finite"));
  EXPECT_THAT(with(0, 0, std::numeric_limits<double>::infinity()), HasSubstr("not finite"));
  EXPECT_THAT(with(0, limits_.upper[0] + degToRad(1)), HasSubstr("a joint limit is broken: primary"));
  EXPECT_THAT(with(3, limits_.lower[3] - 0.005), HasSubstr("a joint limit is broken: table y"));
  EXPECT_THAT(with(1, 30), HasSubstr("wrong units")) << "degrees for radians";
  EXPECT_THAT(with(4, -120), HasSubstr("wrong units")) << "millimetres for metres";
  EXPECT_THAT(with(0, 0, 20), HasSubstr("wrong units")) << "degrees a second";
}

TEST_F(Freshness, JointsDoNotLeap) {
  EXPECT_EQ(said(state(1), 1), "");
  CArmState leapt = state(2);
  leapt.joints[0] = degToRad(5);  // In a fifteenth of a second, at no more than 25 deg/s.
  EXPECT_THAT(said(leapt, 2), HasSubstr("further than it can have moved"));
  CArmState late = state(1);
  EXPECT_THAT(said(late, 3), HasSubstr("late"));
}

}  // namespace
}  // namespace angio::test

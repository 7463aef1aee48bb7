// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/state_history.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/messaging/mailbox.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

class JointHistories : public testing::Test {
 protected:
  // At t the primary angle is t in seconds.
  void say(std::int64_t time_us) {
    CArmState state;
    state.time_us = time_us;
    state.sequence = time_us;
    state.joints[0] = 1e-6 * static_cast<double>(time_us);
    publish(*bus_, kCArmStateChannel, state);
    bus_->handle(std::chrono::milliseconds(0));
  }
  double primary(std::int64_t time_us) const { return history_.at(time_us)->joints[0]; }

  std::unique_ptr<Bus> bus_ = openBus("memq://");
  JointHistory history_{*bus_, kCArmStateChannel};
};

TEST_F(JointHistories, GiveTheJointsOfTheFramesOwnTime) {
  EXPECT_TRUE(history_.empty());
  EXPECT_FALSE(history_.at(0));
  for (const std::int64_t t : {100'000, 150'000, 220'000}) say(t);
  for (const std::int64_t t : {100'000, 120'000, 150'000, 219'000, 220'000}) {
    EXPECT_NEAR(primary(t), 1e-6 * static_cast<double>(t), 1e-12);
    EXPECT_EQ(history_.at(t)->time_us, t);
  }
}

TEST_F(JointHistories, OutsideAndInGapsTheNearestSaysHowFarOffItIs) {
  say(100'000);
  say(400'000);
  EXPECT_EQ(history_.at(50'000)->time_us, 100'000);
  EXPECT_EQ(history_.at(900'000)->time_us, 400'000);
  EXPECT_EQ(history_.at(200'000)->time_us, 100'000);
  EXPECT_EQ(history_.at(300'000)->time_us, 400'000);
}

// The codec refuses what lies further out than 2^52 us, so that doubles tell neighbouring times apart and no difference
// of two times overflows.
TEST_F(JointHistories, TheFarthestTimesGiveNumbers) {
  const std::int64_t far_us = std::int64_t{1} << 52;
  say(far_us - 2);
  say(far_us);
  const auto between = history_.at(far_us - 1);
  ASSERT_TRUE(between);
  EXPECT_TRUE(between->joints.allFinite() && between->velocity.allFinite());
  history_.forget();
  say(-far_us);
  say(far_us);
  EXPECT_EQ(history_.at(1)->time_us, far_us) << "the nearer one";
  EXPECT_THROW(say(far_us + 1), std::invalid_argument);
}

// After a reset an arm whose clock was set back must not go unheard.
TEST_F(JointHistories, BeginAgainWithAnEarlierTimeWhenTheyForget) {
  say(900'000);
  history_.forget();
  EXPECT_TRUE(history_.empty());
  say(100'000);
  ASSERT_FALSE(history_.empty());
  EXPECT_EQ(history_.at(900'000)->time_us, 100'000);
}

TEST_F(JointHistories, LateOnesAndDuplicatesChangeNothing) {
  say(100'000);
  say(150'000);
  say(120'000);
  say(150'000);
  EXPECT_NEAR(primary(130'000), 0.13, 1e-12);
}

TEST_F(JointHistories, ForgetWhatIsOld) {
  for (std::int64_t t = 1; t <= 1000; ++t) say(t * 10'000);
  EXPECT_GT(history_.at(0)->time_us, 7'000'000) << "256 states are kept";
  EXPECT_EQ(history_.at(10'000'000)->time_us, 10'000'000);
}

TEST(DriveHistories, GiveAllThatTheDriveReadAtTheFramesOwnTime) {
  const auto bus = openBus("memq://");
  const DriveHistory history(*bus, kCatheterStateChannel);
  publish(*bus, kCatheterStateChannel, CatheterState{100'000, 1, 1, 2, 3, 4, 5, 6, 7});
  publish(*bus, kCatheterStateChannel, CatheterState{110'000, 2, 2, 4, 6, 8, 10, 12, 14});
  bus->handle(std::chrono::milliseconds(0));
  const auto half = history.at(105'000);
  ASSERT_TRUE(half);
  EXPECT_EQ(half->time_us, 105'000);
  const double read[] = {half->insertion_m,
                         half->roll_rad,
                         half->bend_rad,
                         half->insertion_speed_m_per_s,
                         half->roll_speed_rad_per_s,
                         half->bend_speed_rad_per_s,
                         half->insertion_force_n};
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(read[i], 1.5 * (i + 1), 1e-12) << i;
  EXPECT_EQ(history.newest()->time_us, 110'000);
}

}  // namespace
}  // namespace angio::test

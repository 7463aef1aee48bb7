// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/bus_monitor.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/messaging/any_message.hpp"
#include "random_messages.hpp"

namespace angio::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes stateBytes(std::int64_t sequence, std::int64_t time_us) {
  CArmState state;
  state.sequence = sequence;
  state.time_us = time_us;
  return encode(state);
}

void hear(BusMonitor& monitor, const std::string& channel, const Bytes& bytes, std::int64_t arrival_us) {
  monitor.hear(channel, bytes.data(), bytes.size(), arrival_us);
}

TEST(BusMonitor, TellsLostDoubledLateAndRestartedApart) {
  BusMonitor monitor;
  std::int64_t now_us = 1'000'000;
  // 3 and 4 are jumped over, 4 comes late; 5 comes twice; then the sender begins again at 1.
  for (const auto& [sequence, time_us] :
       {std::pair<int, int>{1, 10}, {2, 20}, {5, 50}, {4, 40}, {5, 50}, {6, 60}, {1, 70}, {2, 80}}) {
    hear(monitor, "S", stateBytes(sequence, time_us), now_us += 1000);
  }
  const auto reports = monitor.report(now_us);
  ASSERT_EQ(reports.size(), 1u);
  EXPECT_EQ(reports[0].type, "carm_state_t");
  EXPECT_EQ(reports[0].messages, 8);
  EXPECT_EQ(reports[0].missing, 1);
  EXPECT_EQ(reports[0].late, 1);
  EXPECT_EQ(reports[0].duplicates, 1);
  EXPECT_EQ(reports[0].restarts, 1);
  EXPECT_EQ(reports[0].undecodable, 0);
}

// An operator's requests are numbered by the clock: several programs, one after the other, make them.
TEST(BusMonitor, GapsOfRequestsAndStatusesSaidAgainAreNoLosses) {
  BusMonitor monitor;
  std::int64_t now_us = 5'000'000'000;
  for (int i = 0; i < 4; ++i) {
    ServoRequest request;
    request.time_us = request.sequence = now_us += 700'000;
    hear(monitor, "REQUEST", encode(request), now_us);
    ServoStatus status;
    status.frame_sequence = 1 + i / 2;
    status.time_us = 10 * status.frame_sequence;
    status.transitions = i;
    hear(monitor, "STATUS", encode(status), now_us);
  }
  ServoRequest again;
  again.time_us = again.sequence = now_us;
  hear(monitor, "REQUEST", encode(again), now_us);
  for (const auto& report : monitor.report(now_us)) {
    EXPECT_EQ(report.missing, 0) << report.channel;
    EXPECT_EQ(report.late, 0) << report.channel;
    EXPECT_EQ(report.duplicates, report.channel == "REQUEST" ? 1 : 0) << report.channel;
  }
  ServoStatus later;
  later.frame_sequence = 9;
  later.time_us = 90;
  hear(monitor, "STATUS", encode(later), now_us);
  EXPECT_EQ(monitor.report(now_us).at(1).missing, 6) << "of frames' numbers, 3 to 8 are losses";
}

TEST(BusMonitor, RatesAndDelaysAreThoseOfTheLastSeconds) {
  BusMonitor monitor(2);
  // 5 Hz for ten seconds, then 20 Hz for three; each message 30 to 50 ms on its way.
  std::int64_t time_us = 0, sequence = 0;
  const auto send = [&](std::int64_t period_us) {
    time_us += period_us;
    ++sequence;
    hear(monitor, "S", stateBytes(sequence, time_us),
         time_us + 30'000 + 10'000 * (sequence % 3));  // 110 % 3 = 2: the last one takes 50 ms.
  };
  for (int i = 0; i < 50; ++i) send(200'000);
  for (int i = 0; i < 60; ++i) send(50'000);
  const auto r = monitor.report(time_us + 50'000).at(0);
  EXPECT_NEAR(r.rate_hz, 20, 0.3);                 // The ends of the window lie up to 20 ms off.
  EXPECT_NEAR(r.bytes_per_s, r.rate_hz * 104, 1);  // 8 of fingerprint, 16, and ten doubles.
  ASSERT_TRUE(r.latency_s);
  EXPECT_NEAR(*r.latency_s, 0.04, 1e-9);
  EXPECT_NEAR(r.delay_spread_s, 0.02, 1e-9);

  const auto later = monitor.report(time_us + 1'050'000).at(0);
  EXPECT_LT(later.rate_hz, 12) << "a channel that has fallen silent slows down";
  EXPECT_NEAR(later.age_s, 1, 1e-9);
  EXPECT_EQ(monitor.report(time_us + 60'000'000).at(0).rate_hz, 0);
}

TEST(BusMonitor, ADifferentClockGivesNoLatency) {
  BusMonitor monitor;
  for (int i = 1; i < 5; ++i) hear(monitor, "S", stateBytes(i, 1000 * i), 1'700'000'000'000'000 + 1000 * i + i);
  const auto r = monitor.report(1'700'000'000'005'000).at(0);
  EXPECT_FALSE(r.latency_s);
  EXPECT_NEAR(r.delay_spread_s, 3e-6, 1e-12);
}

TEST(BusMonitor, AnythingMayCome) {
  test::Random random(3);
  BusMonitor monitor;
  const std::vector<Bytes> sound = {
      encode(test::randomMessage<CArmState>(random)),           encode(test::randomMessage<CArmCommand>(random)),
      encode(test::randomMessage<RegistrationMessage>(random)), encode(test::randomMessage<ServoStatus>(random)),
      encode(test::randomMessage<CatheterTip>(random)),         encode(test::randomFrame(random, 5, 4, CV_16UC1))};
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = sound[static_cast<std::size_t>(random.uniform(0, 6))];
    if (random.uniform(0, 1) < 0.5) bytes.resize(static_cast<std::size_t>(random.uniform(0, 1) * bytes.size()));
    for (int k = 0; k < 3 && !bytes.empty(); ++k) {
      bytes[static_cast<std::size_t>(random.uniform(0, 1) * bytes.size())] =
          static_cast<std::uint8_t>(random.uniform(0, 256));
    }
    hear(monitor, std::string("A\033[2J") + static_cast<char>(static_cast<std::uint8_t>(random.uniform(0, 256))), bytes,
         test::randomInt64(random));
  }
  std::int64_t heard = 0, broken = 0;
  for (const auto& r : monitor.report(test::randomInt64(random))) {
    heard += r.messages;
    broken += r.undecodable;
    for (const std::string& shown : {r.channel, r.type, r.last_value, r.last_error}) {
      EXPECT_TRUE(std::all_of(shown.begin(), shown.end(), [](unsigned char c) { return c >= 0x20 && c < 0x7f; }));
    }
  }
  EXPECT_EQ(heard, 20000);
  EXPECT_GT(broken, 1000);
}

TEST(BusMonitor, ChannelsWithoutEndDoNotFillTheMemory) {
  BusMonitor monitor;
  for (int i = 0; i < 5000; ++i) hear(monitor, "C" + std::to_string(i), {1, 2, 3}, i);
  EXPECT_EQ(monitor.report(5000).size(), 200u);
  EXPECT_EQ(monitor.report(5000)[0].undecodable, 1);
  EXPECT_EQ(monitor.unlisted(), 4800);
  // Messages of our types still find a place, up to 1,000 channels in all.
  for (int i = 0; i < 5000; ++i) hear(monitor, "S" + std::to_string(i), stateBytes(1, 1), 5000 + i);
  EXPECT_EQ(monitor.report(10000).size(), 1000u);
  EXPECT_EQ(monitor.unlisted(), 4800 + 4200);
}

}  // namespace
}  // namespace angio::test

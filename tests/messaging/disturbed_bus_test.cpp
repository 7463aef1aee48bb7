// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/disturbed_bus.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <set>

#include "angio/base/errors.hpp"

namespace angio::test {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

// Two bytes that tell a message from its neighbours.
Bytes numbered(int i) { return {static_cast<std::uint8_t>(i >> 8), static_cast<std::uint8_t>(i & 255)}; }
int numberOf(const Bytes& bytes) { return bytes.at(0) << 8 | bytes.at(1); }

// Publishes one message a millisecond and writes down what comes, and when.
struct Line {
  explicit Line(const DisturbanceSettings& settings, std::uint64_t seed = 1) : bus(*under, settings, seed) {
    bus.subscribe("A", [this](const std::uint8_t* d, std::size_t n) { came.push_back({now_ms, Bytes(d, d + n)}); });
  }
  void run(int messages) {
    for (int i = 0; i < messages; ++i) {
      tick();
      bus.publish("A", numbered(sent++));
      bus.handle(0ms);
    }
  }
  void wait(int ms) {
    for (int i = 0; i < ms; ++i) tick();
  }
  void tick() {
    bus.advance(1000 * ++now_ms);
    bus.handle(0ms);
  }
  std::vector<int> numbers() const {
    std::vector<int> result;
    for (const auto& m : came) result.push_back(numberOf(m.bytes));
    return result;
  }

  struct Came {
    std::int64_t ms;
    Bytes bytes;
  };
  std::unique_ptr<Bus> under = openBus("memq://");
  DisturbedBus bus;
  std::vector<Came> came;
  std::int64_t now_ms = 0;
  int sent = 0;
};

TEST(DisturbedBus, ChangesWhatIsPublishedOnOneChannelUntilThatEnds) {
  Line line({});
  std::vector<Bytes> beside;
  line.bus.subscribe("B", [&](const std::uint8_t* d, std::size_t n) { beside.emplace_back(d, d + n); });
  line.bus.tamper("A", [](Bytes& bytes) { bytes = numbered(numberOf(bytes) + 1000); });
  line.run(2);
  line.bus.publish("B", numbered(7));
  line.bus.handle(0ms);
  line.bus.tamper("A", {});
  line.run(1);
  ASSERT_EQ(line.came.size(), 3u);
  EXPECT_EQ(numberOf(line.came[0].bytes), 1000);
  EXPECT_EQ(numberOf(line.came[1].bytes), 1001);
  EXPECT_EQ(numberOf(line.came[2].bytes), 2);
  ASSERT_EQ(beside.size(), 1u);
  EXPECT_EQ(numberOf(beside[0]), 7);
}

TEST(DisturbedBus, WithDefaultSettingsIsTheBusItself) {
  Line line({});
  line.run(100);
  ASSERT_EQ(line.came.size(), 100u);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(numberOf(line.came[static_cast<std::size_t>(i)].bytes), i);
    EXPECT_EQ(line.came[static_cast<std::size_t>(i)].ms, i + 1) << "it was delayed";
  }
  EXPECT_EQ(line.bus.nextDue_us(), std::nullopt);
}

TEST(DisturbedBus, ADelayIsExactAndKeepsTheOrder) {
  DisturbanceSettings settings;
  settings.delay_ms = 80;
  Line line(settings);
  line.run(1);
  EXPECT_EQ(line.bus.nextDue_us(), 81'000);
  line.run(199);
  line.wait(100);
  ASSERT_EQ(line.came.size(), 200u);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(line.came[static_cast<std::size_t>(i)].ms, i + 81);
}

TEST(DisturbedBus, JitterStaysWithinItsBoundAndKeepsTheOrder) {
  DisturbanceSettings settings;
  settings.delay_ms = 20;
  settings.jitter_ms = 30;
  Line line(settings);
  line.run(500);
  line.wait(100);
  ASSERT_EQ(line.came.size(), 500u);
  std::set<std::int64_t> delays_ms;
  for (int i = 0; i < 500; ++i) {
    const auto& m = line.came[static_cast<std::size_t>(i)];
    ASSERT_EQ(numberOf(m.bytes), i);
    delays_ms.insert(m.ms - (i + 1));
  }
  EXPECT_GE(*delays_ms.begin(), 20);
  EXPECT_LE(*delays_ms.rbegin(), 51);  // Released at the first whole millisecond after they are due.
  EXPECT_GT(delays_ms.size(), 10u);
}

TEST(DisturbedBus, LosesAsManyAsItSays) {
  DisturbanceSettings settings;
  settings.loss_probability = 0.3;
  Line line(settings);
  line.run(5000);
  // Four standard deviations of a binomial count: 4 sqrt(5000 0.3 0.7) = 130.
  EXPECT_NEAR(static_cast<double>(line.bus.counts().lost), 1500, 130);
  EXPECT_EQ(line.came.size() + static_cast<std::size_t>(line.bus.counts().lost), 5000u);
}

TEST(DisturbedBus, LosesInBursts) {
  DisturbanceSettings settings;
  settings.burst_probability = 0.01;
  settings.burst_messages = 20;
  Line line(settings);
  line.run(20'000);
  int bursts = 0, last = -1;
  for (const int number : line.numbers()) {
    bursts += number != last + 1;
    last = number;
  }
  ASSERT_GT(bursts, 0);
  // A mean of some 150 geometric lengths: its standard deviation is 20 / sqrt(150) = 1.6, four of them are allowed.
  EXPECT_NEAR(static_cast<double>(line.bus.counts().lost) / bursts, 20, 6.5);
}

TEST(DisturbedBus, DuplicatesAndOvertakenOnesAllCome) {
  DisturbanceSettings settings;
  settings.duplicate_probability = 0.2;
  settings.reorder_probability = 0.2;
  settings.reorder_delay_ms = 10;
  Line line(settings);
  line.run(2000);
  line.wait(30);
  const std::vector<int> numbers = line.numbers();
  EXPECT_EQ(std::set<int>(numbers.begin(), numbers.end()).size(), 2000u);
  EXPECT_EQ(numbers.size(), 2000u + static_cast<std::size_t>(line.bus.counts().duplicated));
  EXPECT_GT(line.bus.counts().duplicated, 300);
  EXPECT_GT(line.bus.counts().overtaken, 300);
  EXPECT_FALSE(std::is_sorted(numbers.begin(), numbers.end()));
}

TEST(DisturbedBus, CorruptsBytesAndNotLengths) {
  DisturbanceSettings settings;
  settings.corruption_probability = 0.5;
  const auto under = openBus("memq://");
  DisturbedBus bus(*under, settings, 3);
  const Bytes sound(100, 7);
  int wrong = 0;
  bus.subscribe("A", [&](const std::uint8_t* d, std::size_t n) {
    ASSERT_EQ(n, sound.size());
    const auto others = std::count_if(d, d + n, [](std::uint8_t b) { return b != 7; });
    EXPECT_LE(others, 4);
    wrong += others > 0;
  });
  for (int i = 0; i < 500; ++i) bus.publish("A", sound);
  for (int i = 0; i < 10; ++i) bus.publish("B", {});  // Has no byte that could change.
  bus.handle(0ms);
  EXPECT_NEAR(wrong, 250, 50);
}

TEST(DisturbedBus, AStalledLineGivesAllAtOnceWhenItEnds) {
  Line line({});
  line.run(5);
  DisturbanceSettings stalled;
  stalled.stalled = true;
  line.bus.disturb("A", stalled);
  line.run(20);
  EXPECT_EQ(line.came.size(), 5u);
  line.bus.disturb("A", {});
  line.run(1);
  ASSERT_EQ(line.came.size(), 26u);
  const std::vector<int> numbers = line.numbers();
  EXPECT_TRUE(std::is_sorted(numbers.begin(), numbers.end()));
}

TEST(DisturbedBus, AChannelIsDisturbedAloneAndForAWhile) {
  const auto under = openBus("memq://");
  DisturbedBus bus(*under, {}, 1);
  int a = 0, b = 0;
  bus.subscribe("A", [&](const std::uint8_t*, std::size_t) { ++a; });
  bus.subscribe("B", [&](const std::uint8_t*, std::size_t) { ++b; });
  DisturbanceSettings cut;
  cut.loss_probability = 1;
  for (const bool disturbed : {false, true, false}) {
    bus.disturb("A", disturbed ? cut : DisturbanceSettings());
    for (int i = 0; i < 10; ++i) {
      bus.publish("A", {1});
      bus.publish("B", {1});
    }
    bus.handle(0ms);
  }
  EXPECT_EQ(a, 20);
  EXPECT_EQ(b, 30);
}

TEST(DisturbedBus, TheSameSeedDisturbsTheSameWhateverHappensOnOtherChannels) {
  DisturbanceSettings settings;
  settings.loss_probability = settings.duplicate_probability = settings.reorder_probability = 0.3;
  settings.jitter_ms = 20;
  const auto numbers = [&](std::uint64_t seed, bool others) {
    Line line(settings, seed);
    for (int i = 0; i < 300; ++i) {
      if (others) line.bus.publish("B", {1, 2, 3});
      line.run(1);
    }
    line.wait(300);
    return line.numbers();
  };
  EXPECT_EQ(numbers(5, false), numbers(5, true));
  EXPECT_NE(numbers(5, false), numbers(6, false));
}

TEST(DisturbedBus, TimeDoesNotRunBackwardsNorOver) {
  DisturbanceSettings settings;
  settings.delay_ms = 10;
  const auto under = openBus("memq://");
  DisturbedBus bus(*under, settings, 1);
  int came = 0;
  bus.subscribe("A", [&](const std::uint8_t*, std::size_t) { ++came; });
  bus.advance(1'000'000);
  bus.advance(0);
  bus.publish("A", {1});
  EXPECT_EQ(bus.nextDue_us(), 1'010'000);
  bus.advance(std::numeric_limits<std::int64_t>::max());
  bus.publish("A", {2});  // Due at the end of time, which is now.
  bus.handle(0ms);
  EXPECT_EQ(came, 2);
}

TEST(DisturbedBus, RefusesSettingsThatAreNoProbabilities) {
  const auto under = openBus("memq://");
  DisturbanceSettings settings;
  settings.loss_probability = 1.5;
  EXPECT_THROW(DisturbedBus(*under, settings, 1), InputError);
  DisturbedBus bus(*under, {}, 1);
  settings.loss_probability = std::nan("");
  EXPECT_THROW(bus.disturb("A", settings), InputError);
}

}  // namespace
}  // namespace angio::test

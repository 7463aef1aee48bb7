// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/bus.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>

#include "angio/base/errors.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

using namespace std::chrono_literals;

CArmState stateNumber(std::int64_t sequence, std::int64_t time_us) {
  CArmState state;
  state.sequence = sequence;
  state.time_us = time_us;
  return state;
}

TEST(Bus, BringsEachMessageToEverySubscriberOfItsChannelOnly) {
  const auto bus = openBus("memq://");
  std::vector<std::vector<std::uint8_t>> first, second;
  int other = 0;
  const auto into = [](auto& list) {
    return [&](const std::uint8_t* d, std::size_t n) { list.emplace_back(d, d + n); };
  };
  bus->subscribe("A.B", into(first));
  bus->subscribe("A.B", into(second));
  bus->subscribe("AxB", [&](const std::uint8_t*, std::size_t) { ++other; });
  bus->publish("A.B", {1, 2, 3});
  bus->publish("A.B", {4});
  EXPECT_EQ(bus->handle(0ms), 2);
  EXPECT_THAT(first, testing::ElementsAre(testing::ElementsAre(1, 2, 3), testing::ElementsAre(4)));
  EXPECT_EQ(second, first);
  EXPECT_EQ(other, 0);
  EXPECT_EQ(bus->handle(0ms), 0);
}

TEST(Bus, HandlersExceptionComesOutOfHandleAndTheRestIsStillThere) {
  const auto bus = openBus("memq://");
  int calls = 0;
  bus->subscribe("A", [&](const std::uint8_t* data, std::size_t) {
    if (data[0] == 1) throw std::domain_error("from the handler");
  });
  bus->subscribe("A", [&](const std::uint8_t*, std::size_t) { ++calls; });
  bus->publish("A", {1});
  bus->publish("A", {2});
  EXPECT_THROW(bus->handle(0ms), std::domain_error);
  EXPECT_EQ(calls, 1);  // The second subscriber of the same message is not robbed of it.
  EXPECT_EQ(bus->handle(0ms), 1);
  EXPECT_EQ(calls, 2);
}

TEST(Bus, AHandlerMayPublishWithoutCatchingTheCallerForEver) {
  const auto bus = openBus("memq://");
  bus->subscribe("A", [&](const std::uint8_t*, std::size_t) { bus->publish("A", {1}); });
  bus->publish("A", {1});
  EXPECT_EQ(bus->handle(0ms), 1000);
}

TEST(Bus, RefusesWrongUrlsByNameAndRule) {
  for (const std::string url :
       {"", "memq", "tcp://localhost:1", "udpm://no-group", "udpm://300.1.1.1:7667", "udpm://10.0.0.1:7667",
        "udpm://239.255.76.67", "udpm://239.255.76.67:0", "udpm://239.255.76.67:70000",
        "udpm://239.255.76.67:7667?ttl=x", "udpm://239.255.76.67:7667?ttl=256", "udpm://239.255.76.67:7667?speed=0",
        "file:///no/such/folder/x.lcm"}) {
    try {
      openBus(url);
      ADD_FAILURE() << "opened " << url;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(url));
      EXPECT_THAT(error.what(), testing::HasSubstr("bus: url"));
    }
  }
}

TEST(Bus, ALogGivesBackWhatWasRecordedOneByOneAndEnds) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("angio_bus_test_" + std::to_string(getpid()) + ".lcm")).string();
  {
    const auto recorder = openBus("file://" + path + "?mode=w");
    for (int i = 0; i < 3; ++i) publish(*recorder, kCArmStateChannel, stateNumber(i, 10 * i));
  }
  {
    const auto log = openBus("file://" + path + "?speed=0");
    LatestMessage<CArmState> states(*log, kCArmStateChannel);
    for (int i = 0; i < 3; ++i) {
      EXPECT_FALSE(log->ended());
      ASSERT_EQ(log->handle(1s), 1);
      const auto state = states.take();
      ASSERT_TRUE(state);
      EXPECT_EQ(state->sequence, i);
    }
    EXPECT_EQ(log->handle(1s), 0);
    EXPECT_TRUE(log->ended());
  }
  std::filesystem::remove(path);
}

TEST(LatestMessage, KeepsTheNewestAndDropsDuplicatesAndLateOnes) {
  const auto bus = openBus("memq://");
  LatestMessage<CArmState> states(*bus, kCArmStateChannel);
  EXPECT_FALSE(states.peek());
  for (const int sequence : {5, 7, 6, 7, 5}) publish(*bus, kCArmStateChannel, stateNumber(sequence, 100 * sequence));
  bus->handle(0ms);
  ASSERT_TRUE(states.peek());
  EXPECT_EQ(states.peek()->sequence, 7);
  EXPECT_EQ(states.received(), 5);
  EXPECT_EQ(states.dropped(), 3);

  ASSERT_TRUE(states.take());
  publish(*bus, kCArmStateChannel, stateNumber(7, 700));
  bus->handle(0ms);
  EXPECT_FALSE(states.take()) << "a duplicate of a taken message came back";
}

TEST(MessageQueue, KeepsWhatArrivesInItsOrderUntilItIsTaken) {
  const auto bus = openBus("memq://");
  MessageQueue<CArmState> states(*bus, kCArmStateChannel);
  for (const int sequence : {5, 7, 6, 7}) publish(*bus, kCArmStateChannel, stateNumber(sequence, 100 * sequence));
  bus->publish(kCArmStateChannel, {1, 2, 3});
  bus->handle(0ms);
  std::vector<std::int64_t> taken;
  for (const CArmState& state : states.take()) taken.push_back(state.sequence);
  EXPECT_EQ(taken, (std::vector<std::int64_t>{5, 7, 6, 7}));
  EXPECT_TRUE(states.take().empty());
}

TEST(LatestMessage, HearsASenderThatStartedAgain) {
  const auto bus = openBus("memq://");
  LatestMessage<CArmState> states(*bus, kCArmStateChannel);
  publish(*bus, kCArmStateChannel, stateNumber(1000, 50));
  publish(*bus, kCArmStateChannel, stateNumber(1, 51));
  bus->handle(0ms);
  EXPECT_EQ(states.peek()->sequence, 1);
}

TEST(LatestMessage, CountsAndExplainsWhatItCannotDecode) {
  const auto bus = openBus("memq://");
  LatestMessage<CArmState> states(*bus, kCArmStateChannel);
  publish(*bus, kCArmStateChannel, stateNumber(1, 1));
  publish(*bus, kCArmStateChannel, CArmCommand());
  bus->publish(kCArmStateChannel, {});
  bus->handle(0ms);
  EXPECT_EQ(states.peek()->sequence, 1);
  EXPECT_EQ(states.refused(), 2);
  EXPECT_THAT(states.lastError(), testing::HasSubstr("carm_state_t"));
}

TEST(LatestMessage, MayEndBeforeItsBus) {
  const auto bus = openBus("memq://");
  { LatestMessage<CArmState> states(*bus, kCArmStateChannel); }
  publish(*bus, kCArmStateChannel, CArmState());
  EXPECT_EQ(bus->handle(0ms), 1);
}

}  // namespace
}  // namespace angio::test

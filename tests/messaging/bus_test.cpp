// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/bus.hpp"

#include <gmock/gmock.h>

#include <filesystem>

#include "angio/base/errors.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/test/temporary_folder.hpp"
#include "random_messages.hpp"
#include "udp_group.hpp"

namespace angio {
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
  for (const std::string url : {"", "memq", "tcp://localhost:1", "udpm://no-group", "file:///no/such/folder/x.lcm"}) {
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
    LatestValue<CArmState> states(*log, kCArmStateChannel);
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

TEST(LatestValue, KeepsTheNewestAndDropsDuplicatesAndLateOnes) {
  const auto bus = openBus("memq://");
  LatestValue<CArmState> states(*bus, kCArmStateChannel);
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

TEST(EveryValue, KeepsWhatArrivesInItsOrderUntilItIsTaken) {
  const auto bus = openBus("memq://");
  EveryValue<CArmState> states(*bus, kCArmStateChannel);
  for (const int sequence : {5, 7, 6, 7}) publish(*bus, kCArmStateChannel, stateNumber(sequence, 100 * sequence));
  bus->publish(kCArmStateChannel, {1, 2, 3});
  bus->handle(0ms);
  std::vector<std::int64_t> taken;
  for (const CArmState& state : states.take()) taken.push_back(state.sequence);
  EXPECT_EQ(taken, (std::vector<std::int64_t>{5, 7, 6, 7}));
  EXPECT_TRUE(states.take().empty());
}

TEST(LatestValue, HearsASenderThatStartedAgain) {
  const auto bus = openBus("memq://");
  LatestValue<CArmState> states(*bus, kCArmStateChannel);
  publish(*bus, kCArmStateChannel, stateNumber(1000, 50));
  publish(*bus, kCArmStateChannel, stateNumber(1, 51));
  bus->handle(0ms);
  EXPECT_EQ(states.peek()->sequence, 1);
}

TEST(LatestValue, CountsAndExplainsWhatItCannotDecode) {
  const auto bus = openBus("memq://");
  LatestValue<CArmState> states(*bus, kCArmStateChannel);
  publish(*bus, kCArmStateChannel, stateNumber(1, 1));
  publish(*bus, kCArmStateChannel, CArmCommand());
  bus->publish(kCArmStateChannel, {});
  bus->handle(0ms);
  EXPECT_EQ(states.peek()->sequence, 1);
  EXPECT_EQ(states.refused(), 2);
  EXPECT_THAT(states.lastError(), testing::HasSubstr("carm_state_t"));
}

TEST(LatestValue, MayEndBeforeItsBus) {
  const auto bus = openBus("memq://");
  { LatestValue<CArmState> states(*bus, kCArmStateChannel); }
  publish(*bus, kCArmStateChannel, CArmState());
  EXPECT_EQ(bus->handle(0ms), 1);
}

struct Udpm : testing::Test {
  void SetUp() override {
    try {
      openBus(group.url())->subscribe("ANY", [](const std::uint8_t*, std::size_t) {});
    } catch (const InputError& error) {
      GTEST_SKIP() << "no multicast on this machine: " << error.what();
    }
  }

  const test::UdpGroup group;
};

TEST_F(Udpm, BringsOneLargeFrameAcrossTheLoopback) {
  const auto sender = openBus(group.url()), receiver = openBus(group.url());
  LatestValue<XrayFrame> frames(*receiver, kXrayFrameChannel);
  test::Random random(1);
  const XrayFrame sent = test::randomFrame(random, 1024, 1024, CV_16UC1);
  // UDP may lose a frame where the system allows small receive buffers only; it must not lose them all.
  for (int attempt = 0; attempt < 20 && !frames.peek(); ++attempt) {
    publish(*sender, kXrayFrameChannel, sent);
    receiver->handle(500ms);
  }
  const auto received = frames.take();
  ASSERT_TRUE(received) << "nothing came; refused: " << frames.lastError();
  ASSERT_EQ(received->image.size(), sent.image.size());
  ASSERT_EQ(received->image.type(), CV_16UC1);
  EXPECT_TRUE(std::equal(sent.image.begin<std::uint16_t>(), sent.image.end<std::uint16_t>(),
                         received->image.begin<std::uint16_t>()));
}

TEST_F(Udpm, LivesThroughAChannelWithoutAnEnd) {
  const test::TemporaryFolder folder;
  const auto bus = openBus(group.url());
  RecordingBus recorded(*bus, folder.path("run.lcm"));
  std::vector<test::Bytes> heard;
  recorded.subscribe("SERVO_REQUEST",
                     [&](const std::uint8_t* data, std::size_t size) { heard.emplace_back(data, data + size); });
  group.send(test::bytesOf(std::string("LC02\0\0\0\1SERVO_REQUEST", 21)));
  group.send(test::bytesOf(std::string("LC02\0\0\0\2SERVO_REQUEST\0sound", 27)));
  for (int attempt = 0; attempt < 20 && heard.empty(); ++attempt) recorded.handle(100ms);
  EXPECT_THAT(heard, testing::ElementsAre(test::bytesOf("sound")));
  EXPECT_GE(recorded.refused(), 1);
}

}  // namespace
}  // namespace angio

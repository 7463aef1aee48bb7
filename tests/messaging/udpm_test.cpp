// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <thread>

#include "angio/base/errors.hpp"
#include "angio/messaging/bus.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"
#include "random_messages.hpp"
#include "udp_group.hpp"

namespace angio::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

using namespace std::chrono_literals;
using namespace std::string_literals;

struct Udpm : testing::Test {
  void SetUp() override {
    try {
      openBus(group.url())->subscribe("ANY", [](const std::uint8_t*, std::size_t) {});
    } catch (const InputError& error) {
      GTEST_SKIP() << "no multicast on this machine: " << error.what();
    }
  }

  const test::UdpGroup group{};
};

TEST_F(Udpm, BringsOneLargeFrameAcrossTheLoopback) {
  const auto sender = openBus(group.url()), receiver = openBus(group.url());
  LatestMessage<XrayFrame> frames(*receiver, kXrayFrameChannel);
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
  group.send(test::shortDatagram(1, "SERVO_REQUEST"));
  group.send(test::shortDatagram(2, "SERVO_REQUEST"s + '\0' + "sound"));
  for (int attempt = 0; attempt < 20 && heard.empty(); ++attempt) recorded.handle(100ms);
  EXPECT_THAT(heard, testing::ElementsAre(test::bytesOf("sound")));
  EXPECT_EQ(recorded.refused(), 1);
}

TEST_F(Udpm, LivesThroughAFragmentThatEndsBehindItsMessage) {
  const auto bus = openBus(group.url());
  std::vector<test::Bytes> heard;
  bus->subscribe("A", [&](const std::uint8_t* data, std::size_t size) { heard.emplace_back(data, data + size); });
  // Offset and size together are 2^32 and some: they look small in 32 bits.
  group.send(test::LongDatagram{1, 100, 0, 0, 3, "A"s + '\0' + "beginning"}.bytes());
  group.send(test::LongDatagram{1, 100, 0xFFFFFFF0, 1, 3, std::string(32, 'x')}.bytes());
  group.send(test::LongDatagram{2, 100, 0, 0, 1, "A"}.bytes());
  group.send(test::shortDatagram(3, "A"s + '\0' + "sound"));
  for (int attempt = 0; attempt < 20 && heard.empty(); ++attempt) bus->handle(100ms);
  EXPECT_THAT(heard, testing::ElementsAre(test::bytesOf("sound")));
  EXPECT_EQ(bus->refused(), 2);
}

TEST_F(Udpm, BringsAMessageOfThreeMebibytesAndHearsItself) {
  const auto sender = openBus(group.url()), receiver = openBus(group.url());
  test::Bytes sent(3 << 20);
  for (std::size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<std::uint8_t>(i * 2654435761u >> 24);
  std::vector<test::Bytes> at_receiver, at_sender;
  receiver->subscribe("LARGE", [&](const std::uint8_t* d, std::size_t n) { at_receiver.emplace_back(d, d + n); });
  sender->subscribe("LARGE", [&](const std::uint8_t* d, std::size_t n) { at_sender.emplace_back(d, d + n); });
  for (int attempt = 0; attempt < 20 && (at_receiver.empty() || at_sender.empty()); ++attempt) {
    sender->publish("LARGE", sent);
    receiver->handle(300ms);
    sender->handle(300ms);
  }
  ASSERT_FALSE(at_receiver.empty());
  ASSERT_FALSE(at_sender.empty());
  EXPECT_EQ(at_receiver[0], sent);
  EXPECT_EQ(at_sender[0], sent);
}

TEST_F(Udpm, TellsWhoSentAMessageAndWhatOthersSaid) {
  const auto one = openBus(group.url()), other = openBus(group.url());
  std::vector<std::string> senders, overheard;
  one->subscribe("A", [&](const std::uint8_t*, std::size_t) { senders.push_back(one->sender()); });
  one->overhear(
      "A", [&](const std::uint8_t* data, std::size_t size) { overheard.push_back(std::string(data, data + size)); });
  one->publish("A", test::bytesOf("its own"));
  other->publish("A", test::bytesOf("another's"));
  one->publish("A", test::bytesOf("its own again"));
  other->publish("A", test::bytesOf("its own"));
  for (int i = 0; i < 20 && senders.size() < 4; ++i) one->handle(100ms);
  ASSERT_EQ(senders.size(), 4u);
  EXPECT_THAT(overheard, testing::UnorderedElementsAre("another's", "its own"));
  std::sort(senders.begin(), senders.end());
  EXPECT_EQ(senders[0], senders[1]);
  EXPECT_NE(senders[1], senders[2]);
  EXPECT_EQ(senders[2], senders[3]);
  EXPECT_THAT(senders, testing::Each(testing::MatchesRegex("[0-9.]+:[0-9]+")));
  EXPECT_EQ(one->sender(), "") << "outside a handler";
}

TEST_F(Udpm, TakesTheLongestChannelAndRefusesToSendLongerOnes) {
  const auto bus = openBus(group.url());
  const std::string longest(63, 'c');
  int heard = 0;
  bus->subscribe(longest, [&](const std::uint8_t*, std::size_t size) { heard += size == 2; });
  bus->publish(longest, {1, 2});
  for (int attempt = 0; attempt < 20 && heard == 0; ++attempt) bus->handle(100ms);
  EXPECT_EQ(heard, 1);
  for (const std::string& wrong : {std::string(64, 'c'), std::string(), "A"s + '\0'}) {
    EXPECT_THROW(bus->publish(wrong, {1}), std::runtime_error);
  }
}

TEST_F(Udpm, KeepsTheNewestMessagesForABusyReader) {
  const auto bus = openBus(group.url());
  std::vector<int> heard;
  int last = 0;
  bus->subscribe("A", [&](const std::uint8_t* data, std::size_t) { heard.push_back(data[0]); });
  bus->subscribe("END", [&](const std::uint8_t*, std::size_t) { ++last; });
  for (std::uint8_t i = 0; i < 100; ++i) bus->publish("A", {i});
  bus->publish("END", {});
  std::this_thread::sleep_for(200ms);  // The reader is busy.
  bus->handle(1s);
  ASSERT_EQ(heard.size(), 30u);
  EXPECT_EQ(heard.front(), 70);
  EXPECT_EQ(heard.back(), 99);
  EXPECT_EQ(last, 1);
}

TEST_F(Udpm, HandlersExceptionComesOutOfHandleAndTheRestIsStillThere) {
  const auto bus = openBus(group.url());
  int first = 0, all = 0;
  bus->subscribe("A", [&](const std::uint8_t* data, std::size_t) {
    ++first;
    if (data[0] == 1) throw std::domain_error("from the handler");
  });
  bus->subscribeAll([&](const std::string&, const std::uint8_t*, std::size_t) { ++all; });
  bus->publish("A", {1});
  bus->publish("A", {2});
  EXPECT_THROW(bus->handle(1s), std::domain_error);
  EXPECT_EQ(all, 1);
  for (int attempt = 0; attempt < 20 && all < 2; ++attempt) bus->handle(100ms);
  EXPECT_EQ(first, 2);
  EXPECT_EQ(all, 2);
}

TEST_F(Udpm, ASignalEndsTheWait) {
  const auto bus = openBus(group.url());
  bus->subscribe("A", [](const std::uint8_t*, std::size_t) {});
  struct sigaction action {
  }, before{};
  action.sa_handler = [](int) {};
  sigaction(SIGUSR1, &action, &before);
  const pthread_t waiting = pthread_self();
  std::thread other([waiting] {
    std::this_thread::sleep_for(100ms);
    pthread_kill(waiting, SIGUSR1);
  });
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(bus->handle(60s), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 30s);
  other.join();
  sigaction(SIGUSR1, &before, nullptr);
}

// Sound datagrams of every kind, of which most have a few bytes changed, an end cut off or added.
test::Bytes anyDatagram(std::mt19937& random) {
  const std::string channels[] = {"SERVO_REQUEST", "XRAY_FRAME", "A"};
  const std::string head = channels[random() % 3] + '\0';
  test::Bytes datagram;
  if (random() % 2 == 0) {
    datagram = test::shortDatagram(1, head + std::string(random() % 200, 'd'));
  } else {
    const auto number = static_cast<std::uint16_t>(random() % 3);
    const std::uint32_t sizes[] = {50, 70, 30}, offsets[] = {0, 50, 120};
    datagram = test::LongDatagram{static_cast<std::uint32_t>(random() % 2),
                                  150,
                                  offsets[number],
                                  number,
                                  3,
                                  (number == 0 ? head : "") + std::string(sizes[number], 'f')}
                   .bytes();
  }
  for (auto changes = random() % 4; changes > 0; --changes) {
    datagram[random() % datagram.size()] = static_cast<std::uint8_t>(random() % 4 == 0 ? 0xFF : random());
  }
  if (random() % 4 == 0) datagram.resize(random() % (datagram.size() + 40));
  return datagram;
}

TEST_F(Udpm, LivesThroughRandomDatagramsWhileItRecords) {
  const test::TemporaryFolder folder;
  const auto bus = openBus(group.url());
  std::int64_t heard = 0;
  bool sound = false;
  {
    RecordingBus recorded(*bus, folder.path("run.lcm"));
    recorded.subscribeAll([&](const std::string& channel, const std::uint8_t*, std::size_t size) {
      ++heard;
      sound = sound || (channel == "SOUND" && size == 4);
    });
    std::mt19937 random(7);
    for (int i = 0; i < 4000; ++i) {
      group.send(anyDatagram(random));
      if (i % 20 == 0) recorded.handle(0ms);
    }
    for (int attempt = 0; attempt < 20 && !sound; ++attempt) {
      group.send(test::shortDatagram(1, "SOUND"s + '\0' + "data"));
      recorded.handle(100ms);
    }
  }
  EXPECT_TRUE(sound);
  EXPECT_GT(heard, 100);
  EXPECT_GT(bus->refused(), 100);
  LogReader log(folder.path("run.lcm"));
  std::int64_t logged = 0;
  while (log.next()) ++logged;
  EXPECT_EQ(logged, heard);
  EXPECT_EQ(log.skipped_bytes(), 0);
}

}  // namespace
}  // namespace angio::test

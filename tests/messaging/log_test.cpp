// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include <filesystem>

#include "angio/base/errors.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/test/file_size_limit.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<std::pair<std::string, Bytes>> contentOfLog(const std::string& path, std::int64_t* skipped = nullptr) {
  LogReader log(path);
  std::vector<std::pair<std::string, Bytes>> events;
  for (auto event = log.next(); event; event = log.next()) events.emplace_back(event->channel, event->bytes);
  if (skipped) *skipped = log.skipped_bytes();
  EXPECT_EQ(log.position_bytes(), log.size_bytes());
  return events;
}

TEST(RecordingBus, WritesWhatIsHeardAndSaidOnceAndInOrder) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm");
  const auto bus = openBus("memq://");
  int heard = 0;
  {
    RecordingBus recorded(*bus, path);
    recorded.subscribe("IN", [&](const std::uint8_t*, std::size_t) { ++heard; });
    recorded.subscribe("IN", [&](const std::uint8_t*, std::size_t) {
      ++heard;
      recorded.publish("OUT", {9});
    });
    bus->publish("IN", {1});
    bus->publish("NOBODY", {2});
    bus->publish("IN", {3, 4});
    while (recorded.handle(std::chrono::milliseconds(0)) > 0) {
    }
  }
  EXPECT_EQ(heard, 4);
  const auto events = contentOfLog(path);
  ASSERT_EQ(events.size(), 4u);
  EXPECT_EQ(events[0], std::make_pair(std::string("IN"), Bytes{1}));
  EXPECT_EQ(events[1], std::make_pair(std::string("OUT"), Bytes{9}));
  EXPECT_EQ(events[2], std::make_pair(std::string("IN"), Bytes{3, 4}));
  EXPECT_EQ(events[3], std::make_pair(std::string("OUT"), Bytes{9}));
}

TEST(RecordingBus, RefusesAPlaceThatCannotBeWritten) {
  const auto bus = openBus("memq://");
  EXPECT_THROW(RecordingBus(*bus, "/no/such/folder/x.lcm"), InputError);
  EXPECT_THROW(RecordingBus(*bus, "/tmp"), InputError);
  EXPECT_THROW(RecordingBus(*bus, "/dev/full"), InputError);
}

TEST(RecordingBus, RefusesAFullDiskAndLeavesNoFile) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm");
  const auto bus = openBus("memq://");
  const test::FileSizeLimit full(0);
  EXPECT_THROW(RecordingBus(*bus, path), InputError);
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(RecordingBus, RefusesALogThatIsBeingRecorded) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm");
  const auto bus = openBus("memq://");
  {
    RecordingBus first(*bus, path);
    first.publish("OUT", {9});
    EXPECT_THROW(RecordingBus(*bus, path), InputError);
    EXPECT_EQ(first.finish(), std::nullopt);
  }
  EXPECT_GT(std::filesystem::file_size(path), 0u);
}

TEST(RecordingBus, OnAFullDiskItSaysSoKeepsWhatItHasAndTheBusGoesOn) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm");
  const auto bus = openBus("memq://");
  RecordingBus recorded(*bus, path);
  int heard = 0;
  recorded.subscribe("IN", [&](const std::uint8_t*, std::size_t) { ++heard; });
  {
    const test::FileSizeLimit full(10'000);
    for (std::uint8_t i = 0; i < 20; ++i) {
      EXPECT_EQ(recorded.failure().has_value(),
                i > 4);  // An event has 1,030 bytes, and each message is said and heard.
      recorded.publish("IN", Bytes(1000, i));
      if (i < 9) recorded.handle(std::chrono::milliseconds(0));
    }
    ASSERT_TRUE(recorded.failure());
  }
  EXPECT_GT(recorded.handle(std::chrono::milliseconds(0)), 0);
  EXPECT_EQ(heard, 20);
  const auto failure = recorded.finish();
  ASSERT_TRUE(failure);
  EXPECT_THAT(*failure, testing::StartsWith(path));
  EXPECT_THAT(*failure, testing::HasSubstr("File too large"));
  std::int64_t skipped = -1;
  const auto events = contentOfLog(path, &skipped);
  EXPECT_THAT(*failure, testing::HasSubstr("first " + std::to_string(events.size()) + " messages"));
  EXPECT_EQ(skipped, 0);
  for (const auto& [channel, bytes] : events) EXPECT_EQ(bytes.size(), 1000u);
}

TEST(RecordingBus, AFinishedLogIsWholeAndGrowsNoMore) {
  const test::TemporaryFolder folder;
  const auto bus = openBus("memq://");
  RecordingBus recorded(*bus, folder.path("run.lcm"));
  recorded.publish("OUT", {1});
  EXPECT_EQ(recorded.finish(), std::nullopt);
  recorded.publish("OUT", {2});
  EXPECT_EQ(recorded.finish(), std::nullopt);
  EXPECT_EQ(contentOfLog(folder.path("run.lcm")).size(), 1u);
}

TEST(LogBus, ThrowsFromTheMessageOnThatCannotBeWritten) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm");
  const auto log = openBus("file://" + path + "?mode=w");
  log->publish("OUT", Bytes(1000));
  {
    const test::FileSizeLimit full(1500);
    EXPECT_THROW(log->publish("OUT", Bytes(1000)), std::runtime_error);
  }
  EXPECT_THROW(log->publish("OUT", {1}), std::runtime_error);
  EXPECT_EQ(contentOfLog(path).size(), 1u);
}

TEST(LogReader, FindsTheMessagesBehindDamage) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm"), bad = folder.path("bad.lcm");
  {
    const auto log = openBus("file://" + path + "?mode=w");
    for (std::uint8_t i = 0; i < 5; ++i) log->publish("CHANNEL", Bytes(100, i));
  }
  const std::string content = test::contentOf(path);
  const std::size_t event = content.size() / 5;
  const auto read = [&](const std::string& bytes, std::int64_t& skipped) {
    std::ofstream(bad, std::ios::binary) << bytes;
    return contentOfLog(bad, &skipped);
  };
  std::int64_t skipped = 0;
  EXPECT_EQ(read(content, skipped).size(), 5u);
  EXPECT_EQ(skipped, 0);
  // A logger that was killed in the middle of its last message.
  EXPECT_EQ(read(content.substr(0, content.size() - 7), skipped).size(), 4u);
  EXPECT_EQ(skipped, static_cast<std::int64_t>(event) - 7);
  // Rubbish between two messages.
  const auto between = read(content.substr(0, event) + std::string(200'000, '\xED') + content.substr(event), skipped);
  EXPECT_EQ(between.size(), 5u);
  EXPECT_EQ(skipped, 200'000);
  // A length that lies: its message is lost, not the memory.
  std::string lying = content;
  lying[event + 24] = '\x7f';
  EXPECT_EQ(read(lying, skipped).size(), 4u);
}

TEST(LogReader, AnyBytesEnd) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("run.lcm");
  {
    const auto log = openBus("file://" + path + "?mode=w");
    for (std::uint8_t i = 0; i < 5; ++i) log->publish("C", Bytes(20, i));
  }
  const std::string content = test::contentOf(path);
  test::Random random(1);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes = content.substr(0, static_cast<std::size_t>(random.uniform(0, 1) * (content.size() + 1)));
    for (int k = 0; k < 4 && !bytes.empty(); ++k) {
      bytes[static_cast<std::size_t>(random.uniform(0, 1) * bytes.size())] =
          static_cast<char>(static_cast<std::uint8_t>(random.uniform(0, 256)));
    }
    std::ofstream(folder.path("bad.lcm"), std::ios::binary) << bytes;
    EXPECT_LE(contentOfLog(folder.path("bad.lcm")).size(), 5u);
  }
}

TEST(LogReader, NamesTheFileItCannotRead) {
  for (const std::string path : {"/no/such.lcm", "/tmp"}) {
    try {
      LogReader log(path);
      ADD_FAILURE() << "read " << path;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(path));
    }
  }
  EXPECT_EQ(logFileOf("file:///a/b.lcm?speed=0"), "/a/b.lcm");
  EXPECT_EQ(logFileOf("file:///a/b.lcm"), std::nullopt);
  EXPECT_EQ(logFileOf("file:///a/b.lcm?speed=0.5"), std::nullopt);
  EXPECT_EQ(logFileOf("udpm://239.255.76.67:7667?speed=0"), std::nullopt);
}

}  // namespace
}  // namespace angio::test

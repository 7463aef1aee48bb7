// SPDX-License-Identifier: GPL-2.0-or-later
#include <gmock/gmock.h>

#include "angio/base/errors.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/test/random.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio {
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
      bytes[static_cast<std::size_t>(random.uniform(0, 1) * bytes.size())] = static_cast<char>(random.uniform(0, 256));
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
}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/messaging/authenticated_bus.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <numeric>

#include "angio/base/errors.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

// A party of a bus that several share.
class Party final : public Bus {
 public:
  explicit Party(Bus& bus) : bus_(bus) {}
  void publish(const std::string& channel, const Bytes& bytes) override { bus_.publish(channel, bytes); }
  void subscribe(const std::string& channel, Handler handler) override { bus_.subscribe(channel, std::move(handler)); }
  void subscribeAll(Listener listener) override { bus_.subscribeAll(std::move(listener)); }
  void overhear(const std::string& channel, Handler handler) override { bus_.subscribe(channel, std::move(handler)); }
  int handle(std::chrono::milliseconds timeout) override { return bus_.handle(timeout); }
  bool ended() const override { return bus_.ended(); }
  std::int64_t refused() const override { return bus_.refused(); }

 private:
  Bus& bus_;
};

Bytes keyOf(std::uint8_t first) {
  Bytes key(32);
  std::iota(key.begin(), key.end(), first);
  return key;
}

struct KeyedBus : testing::Test {
  AuthenticatedBus party(std::uint8_t key, AuthenticatedBus::Tell tell = {}) {
    return {std::make_unique<Party>(*bus), keyOf(key), std::move(tell), [this] { return now_us; }};
  }
  void handle() {
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
  }
  CArmCommand command() {
    CArmCommand moving;
    moving.sequence = ++sequence;
    moving.velocity[4] = 0.1;
    return moving;
  }

  std::unique_ptr<Bus> bus = openBus("memq://");
  std::int64_t now_us = 1'700'000'000'000'000, sequence = 0;
};

TEST_F(KeyedBus, CarriesPlainMessagesBetweenThoseWithTheKey) {
  AuthenticatedBus loop = party(1), machine = party(1);
  MessageQueue<CArmCommand> commands(machine, kCArmCommandChannel), second(machine, kCArmCommandChannel);
  int overheard = 0, all = 0;
  machine.overhear(kCArmCommandChannel, [&](const std::uint8_t*, std::size_t) { ++overheard; });
  machine.subscribeAll([&](const std::string&, const std::uint8_t* data, std::size_t size) {
    all += decode<CArmCommand>(data, size).value.has_value();
  });
  for (int i = 0; i < 5; ++i) publish(loop, kCArmCommandChannel, command());
  handle();
  const auto heard = commands.take();
  ASSERT_EQ(heard.size(), 5u);
  EXPECT_EQ(heard[4].sequence, 5);
  EXPECT_EQ(heard[4].velocity[4], 0.1);
  EXPECT_EQ(second.take().size(), 5u) << "a message may have several hearers";
  EXPECT_EQ(overheard, 5);
  EXPECT_EQ(all, 5);
  EXPECT_EQ(machine.unauthenticated(), 0);
}

TEST_F(KeyedBus, TakesNothingElseAndNamesEachCauseOnce) {
  std::vector<std::string> told;
  AuthenticatedBus loop = party(1), other = party(2);
  now_us += 1;
  AuthenticatedBus machine = party(1, [&](const std::string& line) { told.push_back(line); });
  MessageQueue<CArmCommand> commands(machine, kCArmCommandChannel);
  MessageQueue<ServoRequest> requests(machine, kServoRequestChannel);
  std::vector<Bytes> recorded;
  bus->subscribe(kCArmCommandChannel, [&](const std::uint8_t* data, std::size_t size) {
    recorded.push_back({data, data + size});
  });
  publish(loop, kCArmCommandChannel, command());
  handle();
  ASSERT_EQ(commands.take().size(), 1u);
  const Bytes sealed = recorded.at(0);

  for (int i = 0; i < 2; ++i) {
    publish(*bus, kCArmCommandChannel, command());
    publish(other, kCArmCommandChannel, command());
    bus->publish(kCArmCommandChannel, sealed);
    bus->publish(kServoRequestChannel, sealed);  // Another channel's.
  }
  for (std::size_t i = 0; i < sealed.size(); ++i) {  // Each byte counts.
    Bytes changed = sealed;
    changed[i] ^= 1;
    bus->publish(kCArmCommandChannel, changed);
    handle();
  }
  for (const std::size_t size : {std::size_t{0}, std::size_t{8}, std::size_t{55}, sealed.size() - 1}) {
    bus->publish(kCArmCommandChannel, {sealed.begin(), sealed.begin() + static_cast<std::ptrdiff_t>(size)});
  }
  handle();
  EXPECT_TRUE(commands.take().empty());
  EXPECT_TRUE(requests.take().empty());
  EXPECT_EQ(machine.causes().at("replayed"), 2);
  EXPECT_EQ(machine.causes().at("no envelope"), 2 + 8 + 3);
  EXPECT_EQ(machine.causes().at("another key"), 2 + 2 + static_cast<std::int64_t>(sealed.size()) - 8 + 1);
  EXPECT_EQ(told.size(), 3u);
  EXPECT_NE(told.at(0).find("CARM_COMMAND is refused: "), std::string::npos) << told.at(0);
}

TEST_F(KeyedBus, ARecordedMessageCountsForNothingWhenever) {
  AuthenticatedBus loop = party(1), machine = party(1);
  MessageQueue<CArmCommand> commands(machine, kCArmCommandChannel);
  std::vector<Bytes> recorded;
  bus->subscribe(kCArmCommandChannel, [&](const std::uint8_t* data, std::size_t size) {
    recorded.push_back({data, data + size});
  });
  for (int i = 0; i < 600; ++i) {
    publish(loop, kCArmCommandChannel, command());
    handle();
  }
  ASSERT_EQ(commands.take().size(), 600u);
  now_us += 1'000'000;
  AuthenticatedBus later = party(1);  // Begins when the loop has ended.
  MessageQueue<CArmCommand> heard_later(later, kCArmCommandChannel);
  for (const Bytes& each : std::vector<Bytes>(recorded)) {
    bus->publish(kCArmCommandChannel, each);
    handle();
  }
  EXPECT_TRUE(commands.take().empty());
  EXPECT_TRUE(heard_later.take().empty());
  EXPECT_EQ(later.causes().at("from before this program began"), 600);
  // One that never arrived, and is sent when it is of no use any more.
  AuthenticatedBus(std::make_unique<Party>(*bus), keyOf(1), {}, [this] {
    return now_us - 5'000'001;
  }).publish(kCArmCommandChannel, encode(command()));
  AuthenticatedBus(std::make_unique<Party>(*bus), keyOf(1), {}, [this] {
    return now_us + 5'000'001;
  }).publish(kCArmCommandChannel, encode(command()));
  handle();
  EXPECT_TRUE(commands.take().empty());
  EXPECT_EQ(
      machine.causes().at("from before this program began") + machine.causes().at("its clock is too far from ours"), 2);
}

TEST_F(KeyedBus, TakesMessagesInAnyOrderOnce) {
  AuthenticatedBus loop = party(1), machine = party(1);
  MessageQueue<CArmCommand> commands(machine, kCArmCommandChannel);
  std::vector<Bytes> sealed;
  const auto elsewhere = openBus("memq://");
  elsewhere->subscribe(kCArmCommandChannel, [&](const std::uint8_t* data, std::size_t size) {
    sealed.push_back({data, data + size});
  });
  AuthenticatedBus far(std::make_unique<Party>(*elsewhere), keyOf(1), {}, [this] { return now_us; });
  for (int i = 0; i < 20; ++i) publish(far, kCArmCommandChannel, command());
  while (elsewhere->handle(std::chrono::milliseconds(0)) > 0) continue;
  ASSERT_EQ(sealed.size(), 20u);
  for (int round = 0; round < 2; ++round) {
    for (auto each = sealed.rbegin(); each != sealed.rend(); ++each) bus->publish(kCArmCommandChannel, *each);
    handle();
  }
  EXPECT_EQ(commands.take().size(), 20u);
  EXPECT_EQ(machine.causes().at("replayed"), 20);
}

TEST_F(KeyedBus, ItsOwnMessageFromElsewhereIsReplayed) {
  AuthenticatedBus loop = party(1);
  int overheard = 0;
  loop.overhear(kCArmCommandChannel, [&](const std::uint8_t*, std::size_t) { ++overheard; });
  publish(loop, kCArmCommandChannel, command());  // Party's overhear() hands out all that comes.
  handle();
  EXPECT_EQ(overheard, 0);
  EXPECT_EQ(loop.causes().at("replayed"), 1);
}

TEST_F(KeyedBus, LeavesImagesAndStatesAsTheyAre) {
  AuthenticatedBus loop = party(1);
  LatestMessage<CArmState> states(loop, kCArmStateChannel);
  publish(*bus, kCArmStateChannel, CArmState{1, 1, CArmJoints::Zero(), CArmJoints::Zero()});
  handle();
  EXPECT_TRUE(states.peek());
  for (const char* channel : {kXrayFrameChannel, kCatheterStateChannel, kServoInputChannel, kCatheterInputChannel}) {
    EXPECT_FALSE(isAuthenticated(channel)) << channel;
  }
}

TEST_F(KeyedBus, LogsHoldPlainMessages) {
  const TemporaryFolder folder;
  AuthenticatedBus loop = party(1), machine = party(1);
  RecordingBus recorded(machine, folder.path("run.lcm"));
  MessageQueue<ServoStatus> statuses(recorded, kServoStatusChannel);
  publish(loop, kServoStatusChannel, ServoStatus());
  publish(recorded, kCArmCommandChannel, command());
  publish(*bus, kServoStatusChannel, ServoStatus());  // Without an envelope: not heard, and not in the log.
  handle();
  ASSERT_EQ(recorded.finish(), std::nullopt);
  LogReader log(folder.path("run.lcm"));
  const auto first = log.next(), second = log.next();
  ASSERT_TRUE(first && second);
  EXPECT_TRUE(decode<CArmCommand>(first->bytes.data(), first->bytes.size()).value);
  EXPECT_TRUE(decode<ServoStatus>(second->bytes.data(), second->bytes.size()).value);
  EXPECT_FALSE(log.next());
}

TEST(KeyFiles, AreRefusedWhenOthersMayReadThemOrTheyAreNoKeys) {
  const TemporaryFolder folder;
  const std::string path = folder.write("key", std::string(32, 'k'));
  chmod(path.c_str(), 0600);
  EXPECT_EQ(readKeyFile(path).size(), 32u);
  const auto refusal = [](const std::string& name) -> std::string {
    try {
      readKeyFile(name);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  for (const mode_t mode : {0604, 0640, 0602, 0666}) {
    chmod(path.c_str(), mode);
    EXPECT_NE(refusal(path).find("may be read by others than its owner: chmod 600"), std::string::npos) << mode;
  }
  for (const std::size_t size : {0, 31, 4097}) {
    const std::string other = folder.write("other", std::string(size, 'k'));
    chmod(other.c_str(), 0600);
    EXPECT_NE(refusal(other).find("must be 32 to 4096 bytes"), std::string::npos) << size;
  }
  EXPECT_NE(refusal(folder.path("none")).find("none"), std::string::npos);
  EXPECT_NE(refusal(folder.path("")).find("must be a key file"), std::string::npos) << "a folder";
}

TEST(KeyFiles, AreMissedOnABusThatLeavesTheMachine) {
  EXPECT_TRUE(unprotectedWarning("udpm://239.255.76.67:7667?ttl=1", ""));
  EXPECT_FALSE(unprotectedWarning("udpm://239.255.76.67:7667?ttl=1", "key"));
  EXPECT_FALSE(unprotectedWarning("udpm://239.255.76.67:7667?ttl=0", ""));
  EXPECT_FALSE(unprotectedWarning("file://run.lcm", ""));
}

}  // namespace
}  // namespace angio::test

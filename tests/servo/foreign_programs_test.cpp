// SPDX-License-Identifier: GPL-2.0-or-later
// What other programs on the same network may do to a loop and its machine: over this machine's real UDP loopback.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <regex>

#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/messaging/authenticated_bus.hpp"
#include "angio/simulation/nodes.hpp"
#include "angio/test/namespace.hpp"
#include "angio/types/channels.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

constexpr std::int64_t kHuge = std::int64_t{1} << 62, kPeriod_us = 66'667;

// As regular expressions.
const std::string kAddress = "[0-9.]+:[0-9]+";
const std::string kSendsCommands = kAddress + " sends C-arm commands on CARM_COMMAND, beside this program";

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

// Until a loop has to stand still [us]; where everything is slow, one look at a frame alone takes longer.
constexpr std::int64_t kSoon_us = kSanitized ? 5'000'000 : 200'000;

using Bytes = std::vector<std::uint8_t>;

// A loop, its C-arm with the X-ray, and an operator, as three programs on a network; and somebody else.
struct Network : testing::Test {
  explicit Network(bool keyed) : keyed_(keyed) {}

  void SetUp() override {
    try {
      loop_side = open();
      machine_side = open();
      console = open();
      stranger = openBus(url);
      stranger->subscribeAll([this](const std::string& channel, const std::uint8_t* data, std::size_t size) {
        if (channel != kXrayFrameChannel && recorded.size() < 2000)
          recorded.emplace_back(channel, Bytes(data, data + size));
      });
    } catch (const InputError& error) {
      GTEST_SKIP() << "no multicast on this machine: " << error.what();
    }
    arm.emplace(*machine_side, stage.settings.limits, stage.joints, monotonic_us());
    node.emplace(*loop_side, test::moving(stage.settings), stage.tree);
    person.emplace(*console);
  }

  std::unique_ptr<Bus> open() {
    if (!keyed_) return openBus(url);
    return std::make_unique<AuthenticatedBus>(openBus(url), Bytes(32, 7));
  }

  static void handle(Bus& bus) {
    while (bus.handle(std::chrono::milliseconds(0)) > 0) continue;
  }

  // All programs for about 10 ms.
  void step() {
    usleep(10'000);
    const std::int64_t now_us = monotonic_us();
    handle(*machine_side);
    arm->listen(now_us);
    arm->report(now_us);
    if (now_us >= next_frame_us) {
      next_frame_us = now_us + kPeriod_us;
      stage.joints = arm->arm().state().joints;
      XrayFrame frame = stage.frame(++frames);
      frame.time_us = now_us;
      publish(*machine_side, kXrayFrameChannel, frame);
    }
    handle(*loop_side);
    if (const auto report = node->answer(monotonic_us())) last = report->command;
    handle(*console);
    handle(*stranger);
  }

  // Steps until `done`, at most 5 s; returns how long it took [us].
  template <typename Done>
  std::int64_t until(const Done& done) {
    const std::int64_t began_us = monotonic_us(), max_us = kSanitized ? 60'000'000 : 5'000'000;
    while (!done() && monotonic_us() - began_us < max_us) step();
    return monotonic_us() - began_us;
  }
  void run(std::int64_t time_us) {
    const std::int64_t end_us = monotonic_us() + time_us;
    while (monotonic_us() < end_us) step();
  }

  bool is(ServoState state) const { return node->states().state() == state; }
  bool moves() const { return !arm->arm().state().velocity.isZero(0); }
  double table_m() const { return arm->arm().state().joints.tail<3>().norm(); }

  void startLoop() {
    until([&] {
      person->start(monotonic_us());
      return is(ServoState::kServo) && moves();
    });
    ASSERT_TRUE(is(ServoState::kServo)) << node->states().reason();
    ASSERT_TRUE(moves());
  }

  // The table, at its full speed.
  CArmCommand forged(std::int64_t sequence) const {
    CArmCommand command{monotonic_us(), sequence, frames, 1'000'000, CArmJoints::Zero()};
    command.velocity[4] = stage.settings.limits.velocity[4];
    return command;
  }

  void expectFault(std::int64_t took_us, const std::vector<std::string>& named) {
    EXPECT_TRUE(is(ServoState::kFault)) << node->states().reason();
    EXPECT_LE(took_us, kSoon_us);
    const std::string& reason = node->states().reason();
    EXPECT_TRUE(std::any_of(named.begin(), named.end(), [&](const std::string& one) {
      return std::regex_match(reason, std::regex("a second sender: " + one + ": stop one"));
    })) << reason;
    std::printf("named after %.0f ms: %s\n", 1e-3 * static_cast<double>(took_us), node->states().reason().c_str());
    until([&] { return !moves(); });
    EXPECT_FALSE(moves()) << "a fault stops the machine";
  }

  const bool keyed_;
  std::string url = "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 20000) + "?ttl=0";
  std::unique_ptr<Bus> loop_side, machine_side, console, stranger;
  std::vector<std::pair<std::string, Bytes>> recorded;  // What the stranger heard.
  test::Stage stage;
  std::optional<lab::SimulatedCArmNode> arm;
  std::optional<ServoNode> node;
  std::optional<Operator> person;
  CArmCommand last;
  std::int64_t frames = 0, next_frame_us = 0;
};

struct OpenNetwork : Network {
  OpenNetwork() : Network(false) {}
};
struct KeyedNetwork : Network {
  KeyedNetwork() : Network(true) {}
};

TEST_F(OpenNetwork, ForgedCommandsMoveNothingAndAreAFault) {
  startLoop();
  const double before_m = table_m();
  for (int i = 1; i <= 20; ++i) publish(*stranger, kCArmCommandChannel, forged(last.sequence + i));
  publish(*stranger, kCArmCommandChannel, forged(kHuge));
  expectFault(until([&] { return is(ServoState::kFault); }), {kSendsCommands});
  EXPECT_NEAR(table_m(), before_m, 5e-3) << "the loop's own way in that time, and no more";
  EXPECT_EQ(arm->arm().ignored().other_sender, 21);
}

TEST_F(OpenNetwork, NoNumberLocksOutALoopOrAStop) {
  arm->report(monotonic_us());
  CArmCommand first = forged(kHuge);
  publish(*stranger, kCArmCommandChannel, first);
  until([&] { return moves(); });
  ASSERT_TRUE(moves()) << "a machine that nobody commands obeys whom it hears";
  first = {};
  first.time_us = first.sequence = 1;
  publish(*console, kCArmCommandChannel, first);
  until([&] { return !moves(); });
  EXPECT_FALSE(moves()) << "anybody may stop it";
  startLoop();  // Its first number is far below.
}

TEST_F(OpenNetwork, ARecordedCommandIsAnothersToo) {
  startLoop();
  const auto found = std::find_if(recorded.rbegin(), recorded.rend(),
                                  [](const auto& message) { return message.first == kCArmCommandChannel; });
  ASSERT_NE(found, recorded.rend());
  stranger->publish(found->first, found->second);
  expectFault(until([&] { return is(ServoState::kFault); }), {kSendsCommands});
}

TEST_F(OpenNetwork, ASecondLoopIsAFault) {
  startLoop();
  ServoNode second(*stranger, test::moving(stage.settings), stage.tree);
  const std::int64_t took_us = until([&] {
    second.answer(monotonic_us());
    return is(ServoState::kFault);
  });
  // It speaks with its first frame; its command may come before its status.
  expectFault(std::max<std::int64_t>(0, took_us - kPeriod_us),
              {"two loops on SERVO_STATUS: this program and " + kAddress, kSendsCommands});
}

TEST_F(OpenNetwork, ASecondArmIsAFault) {
  startLoop();
  lab::SimulatedCArmNode second(*stranger, stage.settings.limits, stage.joints, monotonic_us());
  const std::int64_t took_us = until([&] {
    second.report(monotonic_us());
    return is(ServoState::kFault);
  });
  expectFault(took_us, {"two C-arms on CARM_STATE: " + kAddress + " and " + kAddress});
}

TEST_F(OpenNetwork, ASecondXrayIsAFault) {
  startLoop();
  XrayFrame other = stage.frame(1);
  const std::int64_t took_us = until([&] {
    other.time_us = monotonic_us();
    ++other.sequence;
    publish(*stranger, kXrayFrameChannel, other);
    return is(ServoState::kFault);
  });
  expectFault(took_us, {"two X-rays on XRAY_FRAME: " + kAddress + " and " + kAddress});
}

TEST_F(KeyedNetwork, TakesNothingFromProgramsWithoutTheKey) {
  startLoop();
  auto* machine = dynamic_cast<AuthenticatedBus*>(machine_side.get());
  auto* loop = dynamic_cast<AuthenticatedBus*>(loop_side.get());
  ASSERT_TRUE(machine && loop);
  // All that was heard so far, again; and all that one can make up, without a key and with another.
  AuthenticatedBus other_key(openBus(url), Bytes(32, 8));
  const auto replayed = recorded;
  for (const auto& [channel, bytes] : replayed) {
    if (!isAuthenticated(channel)) continue;
    stranger->publish(channel, bytes);
    if (channel != kCArmCommandChannel) step();
  }
  std::int64_t made_up = 0;
  for (Bus* bus : {stranger.get(), static_cast<Bus*>(&other_key)}) {
    for (const std::int64_t sequence : {last.sequence + 1, last.sequence + 2, kHuge}) {
      publish(*bus, kCArmCommandChannel, forged(sequence));
      CArmCommand stop = forged(sequence);
      stop.velocity.setZero();
      publish(*bus, kCArmCommandChannel, stop);
      publish(*bus, kServoSessionChannel, ServoSession{sequence, sequence, sequence, 0});
      for (int kind = 0; kind < kServoRequestKindCount; ++kind) {
        ServoRequest request{monotonic_us(), kHuge + kind, 0, node->states().transitions(),
                             static_cast<ServoRequestKind>(kind)};
        publish(*bus, kServoRequestChannel, request);
      }
      publish(*bus, kServoStatusChannel, ServoStatus());
      made_up += 9;
    }
    run(200'000);
  }
  EXPECT_TRUE(is(ServoState::kServo) || is(ServoState::kHold)) << node->states().reason();
  EXPECT_EQ(node->states().log().front().cause, ServoCause::kArmRequested);
  for (const ServoTransition& change : node->states().log()) {
    EXPECT_NE(change.cause, ServoCause::kStopRequested);
    EXPECT_NE(change.cause, ServoCause::kSecondSender);
  }
  EXPECT_EQ(arm->arm().ignored().total(), 0) << "none of them came as far as the machine";
  EXPECT_GE(loop->unauthenticated() + machine->unauthenticated(), made_up);
  EXPECT_GT(machine->causes().at("replayed"), 0);
  EXPECT_GT(machine->causes().at("no envelope"), 0);
  EXPECT_GT(machine->causes().at("another key"), 0);
  std::printf("refused: %lld by the loop, %lld by the machine\n", static_cast<long long>(loop->unauthenticated()),
              static_cast<long long>(machine->unauthenticated()));
  person->ask(ServoRequestKind::kStop, monotonic_us());
  until([&] { return is(ServoState::kIdle) && !moves(); });
  EXPECT_TRUE(is(ServoState::kIdle) && !moves()) << "whoever has the key stops it";
}

}  // namespace
}  // namespace angio::test

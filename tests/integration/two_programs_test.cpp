// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/test/file_size_limit.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/program.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"
#include "hepatic.hpp"

namespace angio::test {
namespace {

const char* const kSeconds = test::kSanitized ? "20" : "5";

// Two programs on this machine's loopback; this one listens.
struct TwoPrograms : testing::Test {
  void SetUp() override {
    try {
      bus = openBus(url);
      listen();
    } catch (const InputError& error) {
      GTEST_SKIP() << "no multicast on this machine: " << error.what();
    }
  }
  virtual void listen() = 0;

  // The simulator at a few frames a second, another one, and one that helps it, if any; all end by themselves.
  void run(const std::string& program, const std::vector<std::string>& its, const std::vector<std::string>& simulators,
           const std::string& helper = "", int exit_code = 0) {
    const std::vector<std::string> shared = {"--bus",         url,
                                             "--duration-s",  kSeconds,
                                             "--tree",        test::exampleData("hepatic-tace/tree.csv"),
                                             "--calibration", test::exampleData("hepatic-tace/carm.yaml")};
    auto answering = shared, simulating = shared;
    answering.insert(answering.end(), its.begin(), its.end());
    simulating.insert(simulating.end(), {"--frame-rate-hz", test::kSanitized ? "1" : "5"});
    simulating.insert(simulating.end(), simulators.begin(), simulators.end());
    std::optional<test::RunningProgram> third;
    if (!helper.empty()) third.emplace(helper, shared);
    test::RunningProgram first(program, answering), simulator("angio-simulate", simulating);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::stoi(kSeconds));
    while (std::chrono::steady_clock::now() < end) bus->handle(std::chrono::milliseconds(100));
    shown = simulator.end();
    answered = first.end();
    if (third) {
      const test::Ended helped = third->end();
      ASSERT_EQ(helped.exit_code, 0) << helped.err;
    }
    // What was sent between the last look and the programs' ends is still to be read.
    while (bus->handle(std::chrono::milliseconds(100)) > 0) continue;
    ASSERT_EQ(shown.exit_code, 0) << shown.err;
    ASSERT_EQ(answered.exit_code, exit_code) << answered.err;
  }

  std::string url = "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 20000) + "?ttl=0";
  std::unique_ptr<Bus> bus;
  test::Ended shown, answered;
};

struct ServoAndSimulator : TwoPrograms {
  void listen() override {
    commands = std::make_unique<LatestMessage<CArmCommand>>(*bus, kCArmCommandChannel);
    states = std::make_unique<LatestMessage<CArmState>>(*bus, kCArmStateChannel);
  }
  std::unique_ptr<LatestMessage<CArmCommand>> commands;
  std::unique_ptr<LatestMessage<CArmState>> states;
};

TEST_F(ServoAndSimulator, TheLoopAnswersTheFramesOfTheSimulator) {
  run("angio-servo", {"--autostart"}, {});
  long frames = 0, held = 0;
  ASSERT_EQ(std::sscanf(answered.out.c_str(), "%ld frames answered, %ld held", &frames, &held), 2) << answered.out;
  EXPECT_GT(frames, 0) << shown.out;
  EXPECT_LT(held, frames) << answered.err;
  EXPECT_GT(commands->received(), 0);
  ASSERT_TRUE(states->peek());
  EXPECT_GT(states->peek()->joints[0], 0) << "the arm has begun to turn towards LAO";
}

TEST_F(ServoAndSimulator, TheLoopStandsStillUntilAnOperatorStartsIt) {
  run("angio-servo", {}, {}, "", 3);
  EXPECT_NE(answered.err.find("angio-servo: the loop never moved: all of "), std::string::npos) << answered.err;
  long frames = 0, held = 0;
  ASSERT_EQ(std::sscanf(answered.out.c_str(), "%ld frames answered, %ld held", &frames, &held), 2) << answered.out;
  EXPECT_GT(frames, 0) << shown.out;
  EXPECT_EQ(held, frames);
  EXPECT_GT(commands->received(), 0);
  ASSERT_TRUE(states->peek());
  EXPECT_EQ(states->peek()->joints[0], 0);
  EXPECT_NE(answered.err.find("stands still until it is armed and started (angio-operator, or --autostart)"),
            std::string::npos)
      << answered.err;
}

TEST_F(ServoAndSimulator, SpeakInEnvelopesWithAKeyThatIsTheirOwnersAlone) {
  const test::TemporaryFolder folder;
  const std::string key = folder.write("key", std::string(40, 'k'));
  chmod(key.c_str(), 0600);
  run("angio-servo", {"--autostart", "--key-file", key}, {"--key-file", key});
  EXPECT_GT(commands->received(), 0);
  EXPECT_EQ(commands->refused(), commands->received()) << "whoever has no key cannot read them as commands";
  ASSERT_TRUE(states->peek());
  EXPECT_GT(states->peek()->joints[0], 0) << "the arm has begun to turn towards LAO";
  chmod(key.c_str(), 0644);
  for (const char* program : {"angio-servo", "angio-simulate"}) {
    const auto refused = test::run(program, {"--bus", url, "--key-file", key, "--duration-s", "1"});
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_EQ(refused.err, std::string(program) + ": " + key + ": may be read by others than its owner: chmod 600\n");
  }
}

TEST_F(ServoAndSimulator, TheLoopAnswersWhatAnotherProgramRegisters) {
  run("angio-servo", {"--autostart", "--perception", "bus"}, {}, "angio-register");
  long frames = 0, held = 0;
  ASSERT_EQ(std::sscanf(answered.out.c_str(), "%ld frames answered, %ld held", &frames, &held), 2) << answered.out;
  EXPECT_GT(frames, 0) << shown.out;
  EXPECT_LT(held, frames) << answered.err;
  ASSERT_TRUE(states->peek());
  EXPECT_GT(states->peek()->joints[0], 0) << "the arm has begun to turn towards LAO";
}

// The user is told at once, and again by the last line and the exit code; the loop goes on meanwhile.
TEST_F(ServoAndSimulator, ALogThatCannotBeWrittenEndsTheRecordingAndNotTheLoop) {
  const test::TemporaryFolder folder;
  const std::string log = folder.path("run.lcm");
  std::optional<test::RunningProgram> servo;
  {
    const test::FileSizeLimit full(2000);
    servo.emplace("angio-servo", std::vector<std::string>{"--bus", url, "--autostart", "--record", log, "--duration-s",
                                                          test::kSanitized ? "6" : "4", "--tree",
                                                          test::exampleData("hepatic-tace/tree.csv"), "--calibration",
                                                          test::exampleData("hepatic-tace/carm.yaml")});
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(test::kSanitized ? 6 : 4);
  for (CArmState state; std::chrono::steady_clock::now() < end; ++state.sequence) {
    publish(*bus, kCArmStateChannel, state);
    bus->handle(std::chrono::milliseconds(10));
  }
  const test::Ended ended = servo->end();
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_NE(ended.out.find("0 frames answered"), std::string::npos) << ended.out;
  const std::string line = "angio-servo: " + log + ": recording ended: File too large; it holds the first ";
  const std::size_t first = ended.err.find(line), last = ended.err.rfind(line);
  ASSERT_NE(first, std::string::npos) << ended.err;
  EXPECT_LT(first, last);
  EXPECT_EQ(ended.err.find('\n', last), ended.err.size() - 1) << ended.err;
  LogReader reader(log);
  std::int64_t messages = 0;
  while (reader.next()) ++messages;
  EXPECT_GT(messages, 3);
  EXPECT_EQ(reader.skipped_bytes(), 0);
  EXPECT_NE(ended.err.find(line + std::to_string(messages) + " messages"), std::string::npos) << ended.err;
}

struct NavigatorAndSimulator : TwoPrograms {
  void listen() override {
    commands = std::make_unique<LatestMessage<CatheterCommand>>(*bus, kCatheterCommandChannel);
    states = std::make_unique<LatestMessage<CatheterState>>(*bus, kCatheterStateChannel);
    tips = std::make_unique<LatestMessage<CatheterTip>>(*bus, kCatheterTipChannel);
  }
  std::unique_ptr<LatestMessage<CatheterCommand>> commands;
  std::unique_ptr<LatestMessage<CatheterState>> states;
  std::unique_ptr<LatestMessage<CatheterTip>> tips;
};

// It is the wiring that is looked at: journeys are looked at in simulated time.
TEST_F(NavigatorAndSimulator, TheDriveIsSteeredByTheFramesOfTheSimulator) {
  const test::TemporaryFolder folder;
  const std::string log = folder.path("run.lcm");
  run("angio-navigate", {"--autostart", "--to-branch", "13", "--record", log}, {"--catheter-branch", "0"});
  EXPECT_NE(shown.out.find("the catheter's tip is in branch 0, 30.0 mm into it"), std::string::npos) << shown.out;
  long frames = 0, held = 0;
  ASSERT_EQ(std::sscanf(answered.out.c_str(), "waiting; %ld frames answered, %ld held", &frames, &held), 2)
      << answered.out;
  EXPECT_GT(frames, 0) << shown.out;
  EXPECT_EQ(held, frames) << "the vessels stay full: there is no frame with a catheter alone";
  EXPECT_GT(commands->received(), 0);
  EXPECT_EQ(tips->received(), commands->received());
  ASSERT_TRUE(states->peek());
  EXPECT_NEAR(states->peek()->insertion_m, 30e-3, 1e-9);
  const auto replayed = test::run("angio-replay", {log, "--machine", "catheter", "--to-branch", "13", "--compare",
                                                   "--tree", test::exampleData("hepatic-tace/tree.csv"),
                                                   "--calibration", test::exampleData("hepatic-tace/carm.yaml")});
  EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>

#include "angio/base/errors.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/messaging/mailbox.hpp"
#include "angio/test/program.hpp"
#include "hepatic.hpp"

namespace angio {
namespace {

// Simulator and loop as two programs on this machine's loopback; this one listens.
TEST(TwoPrograms, TheLoopAnswersTheFramesOfTheSimulator) {
  const std::string url = "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 20000) + "?ttl=0";
  std::unique_ptr<Bus> bus;
  std::unique_ptr<LatestValue<CArmCommand>> commands;
  std::unique_ptr<LatestValue<CArmState>> states;
  try {
    bus = openBus(url);
    commands = std::make_unique<LatestValue<CArmCommand>>(*bus, kCArmCommandChannel);
    states = std::make_unique<LatestValue<CArmState>>(*bus, kCArmStateChannel);
  } catch (const InputError& error) {
    GTEST_SKIP() << "no multicast on this machine: " << error.what();
  }
  const std::string seconds = test::kSanitized ? "20" : "4";
  const std::vector<std::string> shared = {"--bus",         url,
                                           "--duration-s",  seconds,
                                           "--tree",        test::exampleData("hepatic-tace/tree.csv"),
                                           "--calibration", test::exampleData("hepatic-tace/carm.yaml")};
  auto slow = shared;
  slow.insert(slow.end(), {"--frame-rate-hz", test::kSanitized ? "1" : "5"});
  test::RunningProgram servo("angio-servo", shared), simulator("angio-simulate", slow);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::stoi(seconds));
  while (std::chrono::steady_clock::now() < end) bus->handle(std::chrono::milliseconds(100));

  const auto shown = simulator.end(), answered = servo.end();
  ASSERT_EQ(shown.exit_code, 0) << shown.err;
  ASSERT_EQ(answered.exit_code, 0) << answered.err;
  long frames = 0, held = 0;
  ASSERT_EQ(std::sscanf(answered.out.c_str(), "%ld frames answered, %ld held", &frames, &held), 2) << answered.out;
  EXPECT_GT(frames, 0) << shown.out;
  EXPECT_LT(held, frames) << answered.err;
  EXPECT_GT(commands->received(), 0);
  ASSERT_TRUE(states->peek());
  EXPECT_GT(states->peek()->joints[0], 0) << "the arm has begun to turn towards LAO";
}

// A patient, a C-arm and a catheter's drive in one program, who steers the drive in another. At a few frames a second
// it is the wiring that is looked at: journeys are looked at in simulated time.
TEST(TwoPrograms, TheDriveIsSteeredByTheFramesOfTheSimulator) {
  const std::string url = "udpm://239.255.76.67:" + std::to_string(20000 + getpid() % 20000) + "?ttl=0";
  std::unique_ptr<Bus> bus;
  std::unique_ptr<LatestValue<CatheterCommand>> commands;
  std::unique_ptr<LatestValue<CatheterState>> states;
  std::unique_ptr<LatestValue<CatheterTip>> tips;
  try {
    bus = openBus(url);
    commands = std::make_unique<LatestValue<CatheterCommand>>(*bus, kCatheterCommandChannel);
    states = std::make_unique<LatestValue<CatheterState>>(*bus, kCatheterStateChannel);
    tips = std::make_unique<LatestValue<CatheterTip>>(*bus, kCatheterTipChannel);
  } catch (const InputError& error) {
    GTEST_SKIP() << "no multicast on this machine: " << error.what();
  }
  const std::string seconds = test::kSanitized ? "20" : "5";
  const std::vector<std::string> shared = {"--bus",         url,
                                           "--duration-s",  seconds,
                                           "--tree",        test::exampleData("hepatic-tace/tree.csv"),
                                           "--calibration", test::exampleData("hepatic-tace/carm.yaml")};
  auto simulating = shared, navigating = shared;
  simulating.insert(simulating.end(), {"--frame-rate-hz", test::kSanitized ? "1" : "5", "--catheter-branch", "0"});
  navigating.insert(navigating.end(), {"--to-branch", "13"});
  test::RunningProgram navigator("angio-navigate", navigating), simulator("angio-simulate", simulating);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::stoi(seconds));
  while (std::chrono::steady_clock::now() < end) bus->handle(std::chrono::milliseconds(100));

  const auto shown = simulator.end(), answered = navigator.end();
  ASSERT_EQ(shown.exit_code, 0) << shown.err;
  ASSERT_EQ(answered.exit_code, 0) << answered.err;
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
}

}  // namespace
}  // namespace angio

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

}  // namespace
}  // namespace angio

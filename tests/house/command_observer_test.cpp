// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rehearsal/command_observer.hpp"

#include <gmock/gmock.h>

#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/random.hpp"

namespace angio {
namespace {

using testing::HasSubstr;

// An arm that believes every command however old, and who watches it.
struct Watched {
  CArmLimits limits = CArmLimits::typical();
  ReceiverSettings gullible = [] {
    ReceiverSettings r;
    r.most_command_age_ms = r.most_command_lead_ms = 60e3;
    return r;
  }();
  SimulatedCArm arm{limits, CArmJoints::Zero(), 0, gullible};
  CommandObserver observer{limits, 0.3};
  std::int64_t now_us = 0, sequence = 0;

  void send(std::int64_t frame, const CArmJoints& velocity, std::int64_t valid_for_us = 200'000) {
    const CArmCommand command{now_us, ++sequence, frame, valid_for_us, velocity};
    observer.arrived(command, now_us);
    arm.obey(command, now_us);
  }
  void wait(std::int64_t duration_us) {
    for (const std::int64_t until_us = now_us + duration_us; now_us < until_us;) {
      now_us = std::min(now_us + 7'000, until_us);
      arm.advance(now_us);
      observer.see(arm.state());
    }
  }
  std::string breach() const { return observer.breach().value_or(""); }
};

TEST(CommandObserver, HasNothingAgainstSoundCommandsAndGapsBetweenThem) {
  Watched w;
  test::Random random(2);
  for (std::int64_t k = 1; k < 2000; ++k) {
    w.observer.exposed(k, w.now_us, std::nullopt);
    w.wait(80'000);
    CArmJoints wanted;
    for (int i = 0; i < kCArmJointCount; ++i) wanted[i] = random.uniform(-1, 1) * w.limits.velocity[i];
    if (k % 5 == 0) wanted = w.limits.velocity;  // Into the ends of the ranges, too.
    if (k % 7 != 0) w.send(k, wanted, 1 + static_cast<std::int64_t>(random.uniform(0, 400'000)));
    ASSERT_EQ(w.breach(), "") << k;
  }
  EXPECT_EQ(w.observer.unsound(), 0);
}

TEST(CommandObserver, SeesAStaleCommandExecuted) {
  Watched w;
  w.observer.exposed(1, 0, std::nullopt);
  w.wait(350'000);
  w.send(1, 0.1 * w.limits.velocity);
  EXPECT_EQ(w.observer.unsound(), 1);
  EXPECT_EQ(w.breach(), "") << "it has arrived, but nothing has moved yet";
  w.wait(20'000);
  EXPECT_THAT(w.breach(), HasSubstr("350 ms before"));
}

TEST(CommandObserver, SeesACommandByASpoiltFrameOrByNoneExecuted) {
  Watched spoilt;
  spoilt.observer.exposed(1, 0, "another patient's");
  spoilt.send(1, 0.1 * spoilt.limits.velocity);
  spoilt.wait(20'000);
  EXPECT_THAT(spoilt.breach(), HasSubstr("another patient's"));
  Watched invented;
  invented.send(77, 0.1 * invented.limits.velocity);
  invented.wait(20'000);
  EXPECT_THAT(invented.breach(), HasSubstr("no frame"));
}

TEST(CommandObserver, SeesAMachineThatDoesNotStopWhenCommandsDo) {
  Watched w;
  w.observer.exposed(1, 0, std::nullopt);
  w.send(1, 0.2 * w.limits.velocity);
  w.wait(200'000);
  CArmState coasting = w.arm.state();
  for (int i = 0; i < 10; ++i) {
    coasting.time_us += 10'000;
    coasting.joints += 0.01 * coasting.velocity;
    w.observer.see(coasting);
  }
  EXPECT_THAT(w.breach(), HasSubstr("by no command"));
}

}  // namespace
}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/drive_force_limiter.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <optional>
#include <vector>

#include "angio/navigation/navigator.hpp"
#include "angio/simulation/simulated_catheter.hpp"

namespace angio::test {
namespace {

constexpr double kLimit_n = 0.8;
constexpr std::int64_t kLatency_us = 80'000;

// A drive whose catheter stands against a spring from `wall_m` on, after a force that it slides with. It moves in steps
// of 1 ms, and each command reaches it the latency after its frame.
struct SpringDrive {
  double stiffness_n_per_m, wall_m, sliding_n, direction;
  double insertion_m = 0, speed_m_per_s = 0, max_n = 0;
  std::int64_t now_us = 0, until_us = 0;
  std::deque<CatheterCommand> on_their_way = {};

  double force_n() const {
    return direction * (sliding_n + stiffness_n_per_m * std::max(direction * insertion_m - wall_m, 0.0));
  }
  CatheterState state() const {
    CatheterState state;
    state.time_us = now_us;
    state.insertion_m = insertion_m;
    state.insertion_speed_m_per_s = speed_m_per_s;
    state.insertion_force_n = force_n();
    return state;
  }
  void advance(std::int64_t time_us) {
    for (; now_us < time_us; now_us += 1000) {
      if (!on_their_way.empty() && now_us >= on_their_way.front().time_us + kLatency_us) {
        speed_m_per_s = on_their_way.front().insertion_speed_m_per_s;
        until_us = now_us + on_their_way.front().valid_for_us;
        on_their_way.pop_front();
      }
      if (now_us >= until_us) speed_m_per_s = 0;
      insertion_m += 1e-3 * speed_m_per_s;
      max_n = std::max(max_n, std::abs(force_n()));
    }
  }
};

CatheterCommand pushOf(double speed_m_per_s, std::int64_t time_us) {
  CatheterCommand command;
  command.time_us = time_us;
  command.valid_for_us = 300'000;
  command.insertion_speed_m_per_s = speed_m_per_s;
  return command;
}

// Pushes for 20 s, or until a frame is the last that is heard of.
void pushOn(SpringDrive& drive, DriveForceLimiter& limiter, double speed_m_per_s, std::int64_t period_us,
            int last_frame = 1000) {
  const std::int64_t began_us = drive.now_us;
  for (int k = 0; k * period_us < 20'000'000; ++k) {
    drive.advance(began_us + k * period_us);
    if (k > last_frame) continue;
    limiter.observe(drive.state());
    const CatheterCommand sent = limiter.limited(pushOf(speed_m_per_s, drive.now_us));
    limiter.commit(sent);
    drive.on_their_way.push_back(sent);
  }
}

// However stiff, up to what it assumes; whatever it slid with before; wherever between two frames the wall comes;
// whichever way; and although no frame comes any more.
TEST(DriveForceLimiter, KeepsTheForceOfADriveAgainstAWallBelowTheLimit) {
  for (const double stiffness : {50.0, 200.0, DriveForceLimiter::assumed_n_per_m}) {
    for (const double sliding_n : {0.0, 0.3, 0.6}) {
      for (const std::int64_t period_us : {33'333, 66'667, 133'333}) {
        for (double wall_m = 10e-3; wall_m < 11e-3; wall_m += 0.13e-3) {
          for (const double direction : {1.0, -1.0}) {
            const double speed = direction * 12e-3;
            SpringDrive drive{stiffness, wall_m, sliding_n, direction};
            DriveForceLimiter limiter(kLimit_n, 1e-6 * kLatency_us);
            pushOn(drive, limiter, speed, period_us);
            // A millisecond of the way is what the plant's steps take the bound by.
            EXPECT_LE(drive.max_n, kLimit_n + stiffness * 12e-6) << stiffness << " " << sliding_n << " " << period_us;
            EXPECT_GE(drive.max_n, DriveForceLimiter::full_share * kLimit_n)
                << "the navigator hears of the wall: " << stiffness << " " << sliding_n << " " << period_us;
            SpringDrive silent{stiffness, 5e-3, sliding_n, direction};
            DriveForceLimiter last(kLimit_n, 1e-6 * kLatency_us);
            pushOn(silent, last, speed, period_us, static_cast<int>(wall_m / 1e-3) + 2);
            EXPECT_LE(silent.max_n, kLimit_n + stiffness * 12e-6);
          }
        }
      }
    }
  }
}

TEST(DriveForceLimiter, LearnsAStifferCatheterAtItsFirstContact) {
  SpringDrive drive{1500, 20e-3, 0, 1};
  DriveForceLimiter limiter(kLimit_n, 1e-6 * kLatency_us);
  pushOn(drive, limiter, 12e-3, 66'667);
  EXPECT_NEAR(limiter.stiffness_n_per_m(), 1500, 1);
  drive.wall_m = drive.insertion_m + 20e-3;  // Elsewhere.
  drive.max_n = 0;
  pushOn(drive, limiter, 12e-3, 66'667);
  EXPECT_LE(drive.max_n, kLimit_n + 1500 * 12e-6);
}

// What a soft hold shows bounds nothing of the next one: an elastic catheter that takes up slack before a fork has a
// hundredth of the stiffness that it has against the end of a vessel.
TEST(DriveForceLimiter, KeepsTheLimitAgainstAWallAfterASoftHold) {
  SpringDrive drive{5, 10e-3, 0.15, 1};
  DriveForceLimiter limiter(kLimit_n, 1e-6 * kLatency_us);
  pushOn(drive, limiter, 12e-3, 66'667);
  ASSERT_GT(drive.max_n, 0.4) << "pressed for long, and softly";
  drive.stiffness_n_per_m = DriveForceLimiter::assumed_n_per_m;
  for (double wall_m = 20e-3; wall_m < 21e-3; wall_m += 0.13e-3) {
    drive.wall_m = drive.insertion_m + wall_m;
    drive.max_n = 0;
    pushOn(drive, limiter, 12e-3, 66'667);
    EXPECT_LE(drive.max_n, kLimit_n + DriveForceLimiter::assumed_n_per_m * 12e-6) << wall_m;
  }
}

TEST(DriveForceLimiter, LeavesAloneWhatIsFarFromTheLimitAndWhatDoesNotPush) {
  DriveForceLimiter limiter(kLimit_n, 1e-6 * kLatency_us);
  CatheterState drive;
  limiter.observe(drive);
  CatheterCommand turn = pushOf(0, 0), slow = pushOf(1e-3, 0), back = pushOf(-8e-3, 0);
  turn.roll_speed_rad_per_s = 2;
  turn.bend_speed_rad_per_s = 1;
  const auto same = [](const CatheterCommand& a, const CatheterCommand& b) {
    return a.insertion_speed_m_per_s == b.insertion_speed_m_per_s && a.roll_speed_rad_per_s == b.roll_speed_rad_per_s &&
           a.bend_speed_rad_per_s == b.bend_speed_rad_per_s && a.valid_for_us == b.valid_for_us;
  };
  EXPECT_TRUE(same(limiter.limited(turn), turn));
  EXPECT_TRUE(same(limiter.limited(slow), slow));
  drive.insertion_force_n = kLimit_n + 0.1;  // Beyond the limit, as an older machine may leave it.
  limiter.observe(drive);
  EXPECT_TRUE(same(limiter.limited(back), back));
  EXPECT_TRUE(same(limiter.limited(turn), turn));
  EXPECT_EQ(limiter.limited(slow).insertion_speed_m_per_s, 0);
}

// A vessel of 100 mm that ends: the navigator is told that its target lies beyond, and presses the tip against the end.
struct WallJourney {
  explicit WallJourney(double radius_m) : tree(vessel(radius_m)) {}

  static VesselTree vessel(double radius_m) {
    Eigen::Matrix3Xd points(3, 101);
    std::vector<int> parents(101);
    for (int i = 0; i <= 100; ++i) {
      points.col(i) << 0, 0, 1e-3 * i;
      parents[static_cast<std::size_t>(i)] = i - 1;
    }
    return VesselTree(points, parents, std::vector<std::optional<double>>(101, radius_m));
  }

  VesselTree tree;
  TreeTopology map{tree};
  double stiffness_n_per_m = 0;
  std::vector<double> max_push_n{0};  // Until the navigator backs off for the first time, the second time, and so on.

  // The largest of all.
  double maxPush_n() const { return *std::max_element(max_push_n.begin(), max_push_n.end()); }

  void run(const CatheterSettings& settings, bool limited, std::size_t contacts) {
    SimulatedCatheter catheter(tree, settings, {0, 60e-3}, 0);
    NavigatorSettings steering;
    steering.fork_speed_mm_per_s = steering.speed_mm_per_s;
    Navigator navigator(tree, {0, map.length_m(0)}, steering);
    DriveForceLimiter limiter(steering.max_force_n, 1e-6 * kLatency_us);
    std::deque<CatheterCommand> on_their_way;
    NavigationState state{};
    // Until it has backed off so many times, and half a second more.
    std::int64_t until_us = 60'000'000;
    for (std::int64_t now_us = 0; now_us < until_us; now_us += 5'000) {
      if (!on_their_way.empty() && now_us == on_their_way.front().time_us + kLatency_us) {
        catheter.obey(on_their_way.front(), now_us);
        on_their_way.pop_front();
      }
      catheter.advance(now_us);
      max_push_n.back() = std::max(max_push_n.back(), catheter.state().insertion_force_n);
      if (now_us % 65'000 != 0) continue;  // About 15 frames a second.
      NavigationInput input;
      input.time_us = now_us;
      input.period_s = 65e-3;
      input.latency_s = 1e-6 * kLatency_us;
      input.drive = catheter.state();
      TipBelief belief;
      belief.status = BeliefStatus::kSeen;
      belief.tip.arc_m = catheter.truth().tip.arc_m - 10e-3;  // It never seems to arrive.
      belief.tip.path_m = belief.tip.arc_m;
      belief.tip.std_m = 1e-3;
      belief.tip.probability = 0.98;
      belief.tip.tip_model = map.point({0, belief.tip.arc_m});
      input.belief = belief;
      const NavigationAnswer answer = navigator.step(input);
      if (answer.state == NavigationState::kBackingOff && state != NavigationState::kBackingOff) {
        max_push_n.push_back(0);
        if (max_push_n.size() > contacts) until_us = now_us + 500'000;
      }
      state = answer.state;
      limiter.observe(input.drive);
      on_their_way.push_back(limited ? limiter.limited(answer.command) : answer.command);
      limiter.commit(on_their_way.back());
    }
    stiffness_n_per_m = limiter.stiffness_n_per_m();
  }
};

// The force at every step of the simulation, not at frames alone; of a kinematic catheter, and of an elastic one in a
// vessel so narrow that it hardly snakes.
TEST(DriveForceLimiter, NavigatorBacksOffAWallAndNeverPushesBeyondTheLimit) {
  constexpr double kRodTrails_m = 0.3e-3;  // Its force is of where the drive was so long a way before.
  for (const bool elastic : {false, true}) {
    CatheterSettings settings;
    if (elastic) settings.elastic.emplace();
    WallJourney free(elastic ? 0.6e-3 : 1.5e-3), limited(elastic ? 0.6e-3 : 1.5e-3);
    free.run(settings, false, 1);
    limited.run(settings, true, 3);
    std::printf("%s: the drive pushes with %.3f N at most, without limiter with %.3f N; %.0f N/m\n",
                elastic ? "elastic" : "kinematic", limited.maxPush_n(), free.maxPush_n(), limited.stiffness_n_per_m);
    ASSERT_EQ(limited.max_push_n.size(), 4U) << "it goes back and tries again";
    const double at_most_n = kLimit_n + (elastic ? kRodTrails_m * DriveForceLimiter::assumed_n_per_m : 0);
    EXPECT_LE(limited.maxPush_n(), at_most_n);
    EXPECT_GT(free.maxPush_n(), at_most_n) << "the wall is one that has to be heeded";
  }
}

}  // namespace
}  // namespace angio::test

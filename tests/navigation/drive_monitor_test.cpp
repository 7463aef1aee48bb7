// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/drive_monitor.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <optional>

#include "angio/geometry/se3.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/simulation/simulated_catheter.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kFrame_us = 66'667;

// A sound drive whose commands come 80 ms after their frames, watched. `between` falsifies what its encoders say.
struct WatchedDrive {
  SimulatedCatheter drive{
      readVesselTree(test::exampleData("hepatic-tace/tree.csv")), CatheterSettings(), {0, 30e-3}, 0};
  DriveMonitor monitor{DriveMonitorSettings(), degToRad(CatheterSettings().max_bend_deg)};
  test::Random random{7};
  CatheterCommand wanted;
  std::optional<CatheterCommand> in_transit;
  std::int64_t now_us = 0, sequence = 0;

  std::optional<std::string> step(const std::function<void(CatheterState&)>& between = {}) {
    CatheterCommand command = wanted;
    command.time_us = now_us;
    command.sequence = ++sequence;
    command.valid_for_us = 300'000;
    monitor.commanded(command);
    if (in_transit) drive.obey(*in_transit, in_transit->time_us + 80'000);
    in_transit = command;
    now_us += kFrame_us;
    drive.advance(now_us);
    CatheterState state = drive.state();
    state.insertion_m += 5e-5 * random.normal();
    state.roll_rad += 5e-3 * random.normal();
    if (between) between(state);
    return monitor.measured(state);
  }
};

TEST(DriveMonitor, LetsASoundDriveDoWhatItIsTold) {
  WatchedDrive w;
  for (int k = 0; k < 1500; ++k) {  // 100 s of ways to and fro, to both ends of the bend.
    if (k % 20 == 0) {
      w.wanted.insertion_speed_m_per_s = w.random.uniform(-10e-3, 10e-3);
      w.wanted.roll_speed_rad_per_s = w.random.uniform(-2, 2);
      w.wanted.bend_speed_rad_per_s = w.random.uniform(-1, 1);
    }
    const auto fault = w.step();
    ASSERT_FALSE(fault) << *fault << " at frame " << k;
  }
}

TEST(DriveMonitor, FindsADriveThatPushesOrRollsByItself) {
  for (const bool rolls : {false, true}) {
    WatchedDrive w;
    for (int k = 0; k < 20; ++k) ASSERT_FALSE(w.step());
    std::optional<std::string> fault;
    int frames = 0;
    for (; !fault && frames < 60; ++frames) {
      const double s = 1e-6 * kFrame_us * (frames + 1);
      fault = w.step(
          [&](CatheterState& state) { (rolls ? state.roll_rad : state.insertion_m) += (rolls ? 1 : 10e-3) * s; });
    }
    ASSERT_TRUE(fault);
    EXPECT_THAT(*fault, HasSubstr(rolls ? "roll moved uncommanded" : "insertion moved uncommanded"));
    EXPECT_LE(frames, rolls ? 7 : 6) << "20 deg at 57 deg/s and 3 mm at 10 mm/s, less what is forgotten";
  }
}

TEST(DriveMonitor, FindsADriveThatStandsStillAndForgetsIt) {
  WatchedDrive w;
  w.wanted.insertion_speed_m_per_s = 8e-3;
  for (int k = 0; k < 15; ++k) ASSERT_FALSE(w.step());
  const double stuck_m = w.drive.state().insertion_m;
  const auto stuck = [&](CatheterState& state) { state.insertion_m = stuck_m; };
  std::optional<std::string> fault;
  int frames = 0;
  for (; !fault && frames < 60; ++frames) fault = w.step(stuck);
  ASSERT_TRUE(fault);
  EXPECT_THAT(*fault, HasSubstr("insertion lags behind its commands"));
  EXPECT_LE(frames, 24) << "10 mm at 8 mm/s are 1.25 s";
  w.monitor.forget();
  EXPECT_FALSE(w.step(stuck));
}

}  // namespace
}  // namespace angio::test

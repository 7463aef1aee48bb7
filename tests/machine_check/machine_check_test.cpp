// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/machine_check/machine_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <opencv2/core.hpp>

#include "angio/simulation/simulated_carm.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

// What a machine may do wrongly. All of it at the machine's door: the arm behind it is right.
struct WrongMachine {
  CArmJoints sign = CArmJoints::Ones();      // Of what it calls +.
  CArmJoints reported = CArmJoints::Ones();  // Unit of what it reports ...
  CArmJoints obeyed = CArmJoints::Ones();    // ... and of what it understands.
  CArmJoints velocity = CArmJoints::Ones();  // Of the velocities that it reports.
  bool swaps_table = false;                  // y and z.
  bool obeys_for_ever = false, ignores_stops = false, obeys_nan = false;
  int turn = 0;  // Of the image: 1 mirrored, 2 turned by 90 deg clockwise.
  double focal = 1, late_s = 0, latency_s = 0.04;
  double clock = 1;
  std::int64_t state_period_us = 10'000;
};

// The arm and the X-ray of a machine, in simulated time.
std::vector<CheckRow> checked(const WrongMachine& wrong, bool move = true) {
  // The patient lies where the table need not move far: what is called + the wrong way round is off by twice as much.
  test::Stage stage;
  stage.tree = VesselTree(stage.tree.points().colwise() - stage.tree.centroid(), stage.tree.parents());
  stage.joints = stage.settings.carm.jointsFor({0, 0}, stage.tree.centroid());
  MachineCheckSettings settings;
  settings.carm = stage.settings.carm;
  settings.T_dsa_cb.translation() << 1.5e-3, -1e-3, 1e-3;
  settings.watch_s = 1.2;
  settings.move = move;
  MachineCheck check(settings, stage.tree);
  CArmJoints begin = stage.joints;
  begin[0] = degToRad(4);
  begin[2] += 3e-3;
  SimulatedCArm arm(settings.limits, begin, 0);
  std::deque<std::pair<std::int64_t, CArmCommand>> in_transit;
  std::deque<XrayFrame> late;
  std::optional<CArmCommand> last;
  std::int64_t sequence = 0, frames = 0, renumbered = 0;
  const auto obey = [&](CArmCommand command, std::int64_t now_us) {
    command.time_us = now_us;
    command.sequence = ++renumbered;
    arm.obey(command, now_us);
  };
  for (std::int64_t now_us = 0; now_us < 60'000'000 && !check.finished(); now_us += 10'000) {
    while (!in_transit.empty() && in_transit.front().first <= now_us) {
      CArmCommand command = in_transit.front().second;
      in_transit.pop_front();
      if (wrong.obeys_nan && !command.velocity.allFinite()) command.velocity = CArmJoints::Constant(0.02);
      if (!command.velocity.allFinite() || (wrong.ignores_stops && command.velocity.isZero(0))) continue;
      command.velocity = command.velocity.cwiseProduct(wrong.sign).cwiseProduct(wrong.obeyed).eval();
      if (wrong.swaps_table) std::swap(command.velocity[3], command.velocity[4]);
      last = command;
      obey(command, now_us);
    }
    if (wrong.obeys_for_ever && last) obey(*last, now_us);
    arm.advance(now_us);
    const auto stamp_us = static_cast<std::int64_t>(std::llround(wrong.clock * static_cast<double>(now_us)));
    if (now_us % wrong.state_period_us == 0) {
      CArmState state = arm.state();
      state.time_us = stamp_us;
      state.sequence = ++sequence;
      if (wrong.swaps_table) {
        std::swap(state.joints[3], state.joints[4]);
        std::swap(state.velocity[3], state.velocity[4]);
      }
      state.joints = state.joints.cwiseProduct(wrong.sign).cwiseProduct(wrong.reported).eval();
      state.velocity =
          state.velocity.cwiseProduct(wrong.sign).cwiseProduct(wrong.reported).cwiseProduct(wrong.velocity).eval();
      check.see(state, now_us);
    }
    if (now_us % 60'000 == 0) {
      stage.joints = arm.state().joints;
      const XrayCamera::Parameters k = stage.settings.carm.camera().parameters();
      XrayCamera::Parameters said = k;
      said.fx_px *= wrong.focal;
      said.fy_px *= wrong.focal;
      XrayFrame frame{stamp_us, ++frames, {}, XrayCamera(said)};
      if (check.looks()) frame.image = stage.frame(frames).image;
      if (wrong.turn == 1 && !frame.image.empty()) cv::flip(frame.image, frame.image, 1);
      if (wrong.turn == 2 && !frame.image.empty()) cv::rotate(frame.image, frame.image, cv::ROTATE_90_CLOCKWISE);
      late.push_back(frame);
    }
    while (!late.empty() &&
           static_cast<double>(now_us) - static_cast<double>(late.front().time_us) >= 1e6 * wrong.late_s) {
      // What was exposed before it looked shows nothing.
      if (!check.looks() || !late.front().image.empty()) check.see(late.front(), now_us);
      late.pop_front();
    }
    if (now_us % 20'000 != 0) continue;
    if (const auto command = check.command(now_us)) {
      in_transit.emplace_back(now_us + std::llround(1e6 * wrong.latency_s), *command);
    }
  }
  EXPECT_TRUE(check.finished());
  arm.advance(70'000'000);
  EXPECT_TRUE(wrong.obeys_for_ever || arm.state().velocity.isZero(1e-9)) << "whatever it finds, it ends at rest";
  return check.rows();
}

const CheckRow* named(const std::vector<CheckRow>& rows, const std::string& name) {
  for (const CheckRow& row : rows) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

TEST(MachineCheck, ARightMachinePassesEveryRow) {
  const auto rows = checked({});
  for (const CheckRow& row : rows) {
    EXPECT_EQ(row.verdict, CheckVerdict::kPass) << row.name << ": " << row.measured << " (" << row.asked << ")";
  }
  for (const char* name : {"primary by the X-ray", "table z by the X-ray", "table y by its encoder", "watchdog", "stop",
                           "NaN", "latency", "velocities", "image orientation", "frame geometry", "joints"}) {
    EXPECT_TRUE(named(rows, name)) << name;
  }
}

struct WrongCase {
  std::string name, row, words;
  WrongMachine machine;
};

void PrintTo(const WrongCase& c, std::ostream* os) { *os << c.name; }

std::vector<WrongCase> wrongMachines() {
  std::vector<WrongCase> cases;
  const auto add = [&](const std::string& name, const std::string& row, const std::string& words,
                       const std::function<void(WrongMachine&)>& spoil) {
    WrongMachine machine;
    spoil(machine);
    cases.push_back({name, row, words, machine});
  };
  for (int i = 0; i < kCArmJointCount; ++i) {
    std::string plain = kJointNames[i];
    plain.erase(std::remove(plain.begin(), plain.end(), ' '), plain.end());
    add("sign_of_" + plain, std::string(kJointNames[i]) + " by the X-ray", "the wrong sign",
        [i](auto& m) { m.sign[i] = -1; });
  }
  add("states_in_degrees", "joints", "wrong units",
      [](auto& m) { m.reported.template head<2>().setConstant(57.29578); });
  add("states_in_millimetres", "joints", "wrong units",
      [](auto& m) { m.reported.template tail<3>().setConstant(1e3); });
  add("commands_in_degrees", "primary by its encoder", "degrees for radians",
      [](auto& m) { m.obeyed[0] = 1 / 57.29578; });
  add("table_axes_swapped", "table y by the X-ray", "another axis", [](auto& m) { m.swaps_table = true; });
  add("mirrored_image", "image orientation", "mirrored left to right", [](auto& m) { m.turn = 1; });
  add("turned_image", "image orientation", "turned by 90 deg anticlockwise", [](auto& m) { m.turn = 2; });
  add("wrong_focal_length", "frame geometry", "fx", [](auto& m) { m.focal = 1.05; });
  add("late_frames", "frame age", "ms behind", [](auto& m) { m.late_s = 0.5; });
  add("slow_states", "CARM_STATE rate", "Hz", [](auto& m) { m.state_period_us = 100'000; });
  add("no_watchdog", "watchdog", "still moving", [](auto& m) { m.obeys_for_ever = true; });
  add("ignores_stops", "stop", "still moving", [](auto& m) { m.ignores_stops = true; });
  add("obeys_nan", "NaN", "moved", [](auto& m) { m.obeys_nan = true; });
  add("slow_to_obey", "latency", "ms", [](auto& m) { m.latency_s = 0.4; });
  add("velocities_in_degrees", "velocities", "of the motion", [](auto& m) { m.velocity[1] = 57.29578; });
  add("milliseconds", "CARM_STATE clock", "in milliseconds", [](auto& m) { m.clock = 1e-3; });
  return cases;
}

class WrongMachines : public testing::TestWithParam<WrongCase> {};

TEST_P(WrongMachines, FailWhereTheyAreWrong) {
  const bool watch_only = GetParam().machine.clock != 1;
  const auto rows = checked(GetParam().machine, !watch_only);
  EXPECT_FALSE(passed(rows));
  const CheckRow* row = named(rows, GetParam().row);
  ASSERT_TRUE(row) << table(rows);
  EXPECT_EQ(row->verdict, CheckVerdict::kFail) << table(rows);
  EXPECT_NE(row->measured.find(GetParam().words), std::string::npos) << row->measured;
}

INSTANTIATE_TEST_SUITE_P(All, WrongMachines, testing::ValuesIn(wrongMachines()),
                         [](const auto& tested) { return tested.param.name; });

TEST(MachineCheck, WithoutBeingAskedItMovesNothing) {
  const auto rows = checked({}, false);
  EXPECT_TRUE(passed(rows)) << table(rows);
  EXPECT_EQ(named(rows, "motion")->verdict, CheckVerdict::kNotSeen);
}

TEST(MachineCheck, NothingOnTheBusIsSaid) {
  test::Stage stage;
  MachineCheckSettings settings;
  settings.carm = stage.settings.carm;
  settings.move = true;
  MachineCheck check(settings, stage.tree);
  for (std::int64_t now_us = 0; now_us < 10'000'000 && !check.finished(); now_us += 20'000) {
    EXPECT_FALSE(check.command(now_us)) << "nothing is moved that does not say where it is";
  }
  EXPECT_TRUE(check.finished());
  EXPECT_EQ(named(check.rows(), "CARM_STATE rate")->verdict, CheckVerdict::kFail);
}

}  // namespace
}  // namespace angio::test

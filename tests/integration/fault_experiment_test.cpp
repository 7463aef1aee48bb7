// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/fault_experiment.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "hepatic.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;

FaultParts partsOf(int seed) {
  FaultParts parts;
  parts.scenario.calibration_error_deg = 1;
  parts.scenario.calibration_error_mm = 3;
  parts.scenario.seed = seed;
  return parts;
}

FaultResult runOf(OperatedMachine machine, FaultKind kind, const FaultParts& parts) {
  return runFault(machine, kind, test::hepaticTree(), test::hepaticCalibration(), parts);
}

class Faults : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Kinds, Faults, testing::Range(0, kFaultKindCount));

TEST_P(Faults, NeverMakeTheCathetersLoopUnsafeAndItSteersAgain) {
  if (test::kSanitized) GTEST_SKIP() << "too slow";
  const auto kind = static_cast<FaultKind>(GetParam());
  const FaultResult row = runOf(OperatedMachine::kCatheter, kind, partsOf(1005));
  EXPECT_TRUE(row.moved_before) << row.fault;
  EXPECT_EQ(row.breach.value_or(""), "") << row.fault;
  EXPECT_TRUE(row.recovered_s) << row.fault;
}

TEST_P(Faults, NeverMakeTheCArmsLoopUnsafeAndItServoesAgain) {
  if (test::kSanitized) GTEST_SKIP() << "too slow";
  const FaultResult row = runOf(OperatedMachine::kCArm, static_cast<FaultKind>(GetParam()), partsOf(3));
  EXPECT_TRUE(row.moved_before) << row.fault;
  EXPECT_EQ(row.breach.value_or(""), "") << row.fault;
  EXPECT_TRUE(row.recovered_s) << row.fault;
}

// The experiment itself, with loops that believe frames however late they are.
TEST(FaultExperiment, SeesALoopThatMovesByLateFrames) {
  if (test::kSanitized) GTEST_SKIP() << "too slow";
  FaultParts parts = partsOf(3);
  parts.controller.safety.freshness.max_frame_age_ms = 10e3;
  const FaultResult catheter = runOf(OperatedMachine::kCatheter, FaultKind::kLateFrames, parts);
  EXPECT_THAT(catheter.breach.value_or(""), HasSubstr("the loop commands motion by a frame of")) << catheter.fault;
  parts.carm_loop.safety.freshness.max_frame_age_ms = 10e3;
  const FaultResult carm = runOf(OperatedMachine::kCArm, FaultKind::kLateFrames, parts);
  EXPECT_THAT(carm.breach.value_or(""), HasSubstr("the loop commands motion by a frame of")) << carm.fault;
}

TEST(FaultExperiment, CountsByMachineAndFault) {
  FaultResult good, bad;
  good.kind = bad.kind = FaultKind::kStall;
  good.recovered_s = 0.4;
  good.error_at_end = 0.25;
  good.moved_before = true;
  bad.machine = OperatedMachine::kCatheter;
  bad.breach = "moved";
  bad.unsound_commands = 3;
  bad.recovered_s = 0.2;  // Without an error: where the tip was, was not known at the end.
  const auto json = faultExperimentAsJson({good, bad, good});
  EXPECT_EQ(json["unsafe"], 1);
  ASSERT_EQ(json["faults"].size(), 4u) << "a fault's line, and all, of each machine";
  EXPECT_EQ(json["faults"][0]["machine"], "carm");
  EXPECT_EQ(json["faults"][0]["runs"], 2);
  EXPECT_EQ(json["faults"][0]["recovered"], 2);
  EXPECT_EQ(json["faults"][0]["recovery_s"]["max"], 0.4);
  EXPECT_EQ(json["faults"][0]["error_at_end"]["max"], 0.25);
  EXPECT_EQ(json["faults"][2]["machine"], "catheter");
  EXPECT_EQ(json["faults"][2]["unsafe"], 1);
  EXPECT_EQ(json["faults"][2]["unsound_commands_at_the_machine"], 3);
  EXPECT_EQ(json["faults"][2]["recovery_s"]["max"], 0.2);
  EXPECT_FALSE(json["faults"][2].contains("error_at_end"));
  EXPECT_FALSE(json["each"][1].contains("error_at_end"));
  EXPECT_EQ(json["faults"][3]["fault"], "all");
  EXPECT_THAT(faultExperimentTable(json), HasSubstr("catheter, seed 0, : moved"));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/experiments/closed_loop.hpp"
#include "angio/navigation/catheter_node.hpp"
#include "angio/results/record_row.hpp"

namespace angio::servo {

constexpr int choicesOf(OperatedMachine) { return 2; }

}  // namespace angio::servo

namespace angio::experiments {

/// What goes wrong in a run of the experiment.
enum class FaultKind {
  kNone,              ///< For comparison.
  kLoss,              ///< Up to half of all messages.
  kDelay,             ///< Up to 500 ms, of frames and states, of commands, or of both.
  kJitter,            ///< Up to 500 ms, of all of them.
  kDuplicates,        ///< Up to half of all messages come twice.
  kReorder,           ///< Up to half of all messages are overtaken.
  kStall,             ///< Nothing comes through, then all at once.
  kNan,               ///< NaN and numbers in wrong units, in states, frames and commands.
  kFrozenImage,       ///< New frames with old pixels.
  kOtherPatient,      ///< Frames of another patient.
  kKilledNode,        ///< The loop dies, and is started again.
  kClockJump,         ///< Of the X-ray's clock, up to 10 s.
  kLateFrames,        ///< All of a loop's frames are late by the same time, from its start on.
  kImpossibleJoints,  ///< One of the arm's joints is said to be where it cannot be.
  kArmClockBack,      ///< The arm's clock, and only that, goes back by 10 s.
};
constexpr int kFaultKindCount = 15;
const char* nameOf(FaultKind kind);

/// What became of one run.
struct FaultResult {
  OperatedMachine machine = OperatedMachine::kCArm;
  int seed = 0;
  FaultKind kind = FaultKind::kNone;
  std::string fault;                  ///< In words, with its numbers.
  std::optional<std::string> breach;  ///< Unsafe: a limit exceeded, or a stale or untrusted command sent or executed.
  int unsound_commands = 0;           ///< Stale or untrusted ones that reached the machine, obeyed or not.
  bool moved_before = false;          ///< It servoed when the fault began.
  std::vector<std::string> causes;    ///< Why the state changed while the fault lasted.
  std::optional<double> recovered_s;  ///< From the fault's end until it servoed steadily; nothing: it did not.
  /// True ones: of the C-arm's view [deg], or of how far the catheter's tip was believed to be from the root [mm];
  /// nothing: there was no desired view, or where the tip was, was not known.
  std::optional<double> error_at_fault, error_at_end;
};

constexpr int choicesOf(FaultKind) { return kFaultKindCount; }

template <typename Fields>
void visitRow(Fields& f, RecordOf<Fields, FaultResult>& result) {
  f("machine", result.machine);
  f("seed", result.seed);
  f("kind", result.kind);
  f("fault", result.fault);
  f("breach", result.breach);
  f("unsound_commands", result.unsound_commands);
  f("moved_before", result.moved_before);
  f("causes", result.causes);
  f("recovered_s", result.recovered_s);
  f("error_at_fault", result.error_at_fault);
  f("error_at_end", result.error_at_end);
}

/// What a run is made of, beside the anatomy.
struct FaultParts {
  ScenarioSettings scenario;
  ServoLoopSettings carm_loop;
  SimulatedPatientSettings patient;
  CatheterSettings catheter;
  CatheterControllerSettings controller;
};

/// One run of one machine's shipped node with one fault: begins sound, is disturbed for a while, and goes on without
/// the fault. The operator resets and arms again when the fault is over. Judged by observers that know the truth and
/// hear the wire. A catheter goes to a branch that the seed chooses under a C-arm that stands still.
FaultResult runFault(OperatedMachine machine, FaultKind kind, const VesselTree& tree, const CArmCalibration& nominal,
                     FaultParts parts);

Json faultExperimentAsJson(const std::vector<FaultResult>& rows);

/// The same as a table for people, a line for each machine and fault.
std::string faultExperimentTable(const Json& summary);

}  // namespace angio::experiments

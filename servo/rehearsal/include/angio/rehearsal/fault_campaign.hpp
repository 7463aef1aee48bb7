// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/rehearsal/rehearsal.hpp"
#include "angio/servo/safety_supervisor.hpp"

namespace angio {

/// What goes wrong in a run of the campaign.
enum class FaultKind {
  kNone,          ///< For comparison.
  kLoss,          ///< Up to half of all messages.
  kDelay,         ///< Up to 500 ms, of frames, joints or commands.
  kJitter,        ///< Up to 500 ms, of all of them.
  kDuplicates,    ///< Up to half of all messages come twice.
  kReorder,       ///< Up to half of all messages are overtaken.
  kStall,         ///< Nothing comes through, then all at once.
  kNan,           ///< NaN and numbers in wrong units, in joints, frames and commands.
  kFrozenImage,   ///< New frames with old pixels.
  kOtherPatient,  ///< Frames of another patient.
  kKilledNode,    ///< The loop dies, and is started again.
  kClockJump,     ///< Of the X-ray's clock, up to 10 s.
};
constexpr int kFaultKindCount = 12;
const char* nameOf(FaultKind kind);

struct FaultCampaignSettings {
  static constexpr double sound_s = 2;      ///< Until the fault begins ...
  static constexpr double disturbed_s = 2;  ///< ... while it lasts ...
  static constexpr double recovery_s = 3;   ///< ... and from its end to the run's.
  int image_px = 512;
  double most_primary_deg = 30;      ///< Views are spread evenly over +- this ...
  double most_secondary_deg = 15;    ///< ... and this; the start is between them.
  double most_command_age_ms = 350;  ///< A command for motion that arrives later after its exposure is a stale one.

  void visit(SettingsVisitor& v) {
    v.integer("image_px", image_px, 128, 4096);
    v.number("most_primary_deg", most_primary_deg, 0, 90);
    v.number("most_secondary_deg", most_secondary_deg, 0, 45);
    v.number("most_command_age_ms", most_command_age_ms, 1, 10e3);
  }
};

/// What became of one run.
struct FaultRow {
  int seed = 0;
  FaultKind kind = FaultKind::kNone;
  std::string fault;                  ///< In words, with its numbers.
  std::optional<std::string> breach;  ///< Unsafe motion: a limit exceeded, or a stale or untrusted command executed.
  int unsound_commands = 0;           ///< Stale or untrusted ones that reached the machine, obeyed or not.
  bool moved_before = false;          ///< It servoed when the fault began.
  std::vector<std::string> causes;    ///< Why the state changed while the fault lasted.
  std::optional<double> recovered_s;  ///< From the fault's end until it servoed to the run's end; nothing: it did not.
  ViewError error_at_fault, error_at_end;  ///< True ones.
};

/// One run with one fault: begins sound, is disturbed for a while, and goes on without the fault. The operator resets
/// and arms again when the fault is over. Judged by observers that know the truth and hear the wire.
FaultRow runFault(const VesselTree& tree, const CArmCalibration& nominal, const FaultCampaignSettings& campaign,
                  FaultKind kind, RehearsalSettings rehearsal, ServoLoopSettings parts,
                  const SimulatedPatientSettings& patient);

nlohmann::ordered_json faultCampaignAsJson(const std::vector<FaultRow>& rows);

/// The same as a table for people, a line for each fault.
std::string faultCampaignTable(const nlohmann::ordered_json& summary);

}  // namespace angio

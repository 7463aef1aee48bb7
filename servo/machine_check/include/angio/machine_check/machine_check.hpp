// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/machine_check/namespace.hpp"
#include "angio/types/carm_motion.hpp"
#include "angio/types/xray_frame.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::machine_check {

enum class CheckVerdict { kPass, kFail, kNotSeen };

/// One line of the table.
struct CheckRow {
  std::string name;
  CheckVerdict verdict = CheckVerdict::kNotSeen;
  std::string measured;  ///< What was seen, in numbers; of a row that was not seen: why not.
  std::string asked;     ///< The rule.
};

/// What is known of the machine, and what a check does with it.
struct MachineCheckSettings {
  CArmGeometry carm;                          ///< As calibrated.
  CArmLimits limits = CArmLimits::typical();  ///< Of the machine.
  Pose T_dsa_cb = Pose::Identity();           ///< The tree in the patient frame, as calibrated.
  double watch_s = 3;
  bool move = false;  ///< Whether it moves the machine after watching; each joint out and back.
  double angle_deg = 2, table_mm = 10;
  double angle_speed_deg_per_s = 2, table_speed_mm_per_s = 10;

  void visit(SettingsVisitor& v);
};

/// Checks a C-arm and its X-ray against what the messages promise: rates, sequences, clocks, units, the image's
/// geometry and orientation by watching; sign, size and axis of each joint by its encoder and by what the X-ray shows,
/// latency, watchdog and stop by moving it a little.
///
/// Knows neither bus nor clock: the caller says what has come and when, and sends what command() gives. A machine that
/// goes further than twice what was asked of it, or moves another joint by more than that, is told to stand still, and
/// what is left of the table stays not seen.
class MachineCheck {
 public:
  /// Throws InputError when a setting is out of its range.
  MachineCheck(const MachineCheckSettings& settings, const VesselTree& tree);
  MachineCheck(MachineCheck&&) noexcept;
  ~MachineCheck();

  /// Takes what has come at `now_us`, the caller's own clock [us].
  void see(const CArmState& state, std::int64_t now_us);
  void see(const XrayFrame& frame, std::int64_t now_us);

  /// What is to be sent at `now_us`; nothing: silence. To be called every 10 to 30 ms.
  std::optional<CArmCommand> command(std::int64_t now_us);

  /// Whether the next frame's image is looked at.
  bool looks() const;

  bool finished() const;

  /// What is being done, for people: "watches", "moves primary", ...
  std::string doing() const;

  /// The table so far.
  std::vector<CheckRow> rows() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Whether nothing failed.
bool passed(const std::vector<CheckRow>& rows);

/// The table for people.
std::string table(const std::vector<CheckRow>& rows);

}  // namespace angio::machine_check

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/mailbox.hpp"
#include "angio/navigation/catheter_guide.hpp"
#include "angio/navigation/drive_monitor.hpp"
#include "angio/servo/freshness_gate.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_state_machine.hpp"
#include "angio/servo/state_history.hpp"

namespace angio {

/// How a catheter's node looks, and when its drive may move.
struct CatheterNodeSettings {
  CatheterGuideSettings guide;
  ServoStateSettings states;
  FreshnessSettings freshness;
  DriveMonitorSettings drive;
  double most_drive_age_ms = 150;  ///< Between a frame and the drive's state that it is read with.

  void visit(SettingsVisitor& v) {
    guide.visit(v);
    v.section("states", [this](SettingsVisitor& s) { states.visit(s); });
    v.section("freshness", [this](SettingsVisitor& s) { freshness.visit(s); });
    v.section("drive", [this](SettingsVisitor& s) { drive.visit(s); });
    v.number("most_drive_age_ms", most_drive_age_ms, 1, 10e3);
  }
};

/// The catheter's side of a bus: hears XRAY_FRAME, CARM_STATE, CATHETER_STATE and CATHETER_REQUEST, says
/// CATHETER_COMMAND, CATHETER_TIP, CATHETER_STATUS, CATHETER_INPUT and REGISTRATION. The drive stands still until an
/// operator has armed and started it, and is at fault when it does not do what it is told. What a frame is answered
/// with is its guide's.
class CatheterNode {
 public:
  /// Borrows the bus, which must outlive it. Throws InputError when a setting is out of its range, or a place is none
  /// of the tree's.
  CatheterNode(Bus& bus, const CatheterStage& stage, const VesselTree& tree, const TreePlace& start,
               const TreePlace& target, const CatheterNodeSettings& settings);

  /// Hears what has come, and answers the newest frame that waits; nothing comes back when none does. To be called
  /// whenever the bus was handled, and at least as often as frames should come.
  ///
  /// @param now_us  The caller's own clock [us].
  std::optional<CatheterGuideReport> answer(std::int64_t now_us);

  /// Frames and states that could not be decoded.
  std::int64_t refused() const { return frames_.refused() + joints_.refused() + drive_.refused(); }

  const ServoStateMachine& states() const { return states_; }
  NavigationState navigation() const { return guide_.navigation(); }

 private:
  void hear(std::int64_t now_us);
  CatheterGuideReport answerOf(const XrayFrame& frame, const CArmState& arm, std::int64_t now_us);
  std::optional<std::string> objection(const XrayFrame& frame, const CArmState& arm,
                                       const std::optional<CatheterState>& drive, std::int64_t now_us);
  void say(ServoStatus status);

  Bus& bus_;
  CatheterNodeSettings settings_;
  LatestValue<XrayFrame> frames_;
  DriveHistory drive_;
  JointHistory joints_;
  HeardRequests requests_;
  ServoStateMachine states_;
  FreshnessGate freshness_;
  DriveMonitor motion_;
  CatheterGuide guide_;
  std::int64_t said_transitions_ = 0;
  ServoStatus last_status_;
};

}  // namespace angio

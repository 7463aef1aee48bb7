// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/messaging/mailbox.hpp"
#include "angio/navigation/catheter_loop.hpp"
#include "angio/navigation/drive_monitor.hpp"
#include "angio/servo/freshness_gate.hpp"
#include "angio/servo/joint_history.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/perception.hpp"
#include "angio/servo/servo_state_machine.hpp"
#include "angio/servo/supervisor.hpp"

namespace angio {

/// How a catheter's node looks, and when its drive may move.
struct CatheterNodeSettings {
  CatheterLoopSettings loop;
  PerceptionSettings perception;  ///< Of the roadmap.
  SupervisorSettings supervisor;  ///< The same: which registrations are believed.
  ServoStateSettings states;
  FreshnessSettings freshness;
  DriveMonitorSettings drive;
  int roadmap_frames = 3;            ///< Believed registrations in a row that make a roadmap ...
  int washed_out_frames = 3;         ///< ... and frames in a row without one, before the catheter alone is looked for.
  double most_drive_age_ms = 150;    ///< Between a frame and the drive's state that it is read with.
  double most_turn_deg = 0.3;        ///< Of the C-arm since the roadmap; more, and another one is needed.
  double most_shift_error_mm = 0.5;  ///< The same, of the table: what the roadmap's unsure depth makes of its way.

  void visit(SettingsVisitor& v) {
    loop.visit(v);
    v.section("supervisor", [this](SettingsVisitor& s) { supervisor.visit(s); });
    v.section("states", [this](SettingsVisitor& s) { states.visit(s); });
    v.section("freshness", [this](SettingsVisitor& s) { freshness.visit(s); });
    v.section("drive", [this](SettingsVisitor& s) { drive.visit(s); });
    v.integer("roadmap_frames", roadmap_frames, 1, 1000);
    v.integer("washed_out_frames", washed_out_frames, 1, 1000);
    v.number("most_drive_age_ms", most_drive_age_ms, 1, 10e3);
    v.number("most_turn_deg", most_turn_deg, 0.01, 30);
    v.number("most_shift_error_mm", most_shift_error_mm, 0.01, 100);
  }
};

/// Where the C-arm is, and how the patient lies in it.
struct CatheterStage {
  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical();
  Pose T_dsa_cb = Pose::Identity();  ///< Calibrated: model frame in the patient frame.
};

/// What became of one frame.
struct CatheterNodeReport {
  CatheterReport loop;              ///< Of a frame that showed the catheter; else at rest.
  CatheterCommand command;          ///< As it went on the bus.
  std::optional<std::string> held;  ///< Why the drive stands still; nothing while it may move.
  bool roadmap = false;             ///< The frame was looked at for vessels.
};

/// The catheter's side of a bus: hears XRAY_FRAME, CARM_STATE, CATHETER_STATE and CATHETER_REQUEST, says
/// CATHETER_COMMAND, CATHETER_TIP, CATHETER_STATUS and REGISTRATION. The drive stands still until an operator has armed
/// and started it, and is at fault when it does not do what it is told.
///
/// A roadmap comes first: frames with contrast agent, from which the tree is registered, until the agent has washed
/// out. Then each frame is looked at for the catheter along the registered tree, and REGISTRATION says where that tree
/// is. When the C-arm has turned, or the table has gone far, the next roadmap is waited for.
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
  std::optional<CatheterNodeReport> answer(std::int64_t now_us);

  /// Frames and states that could not be decoded.
  std::int64_t refused() const { return frames_.refused() + joints_.refused() + drive_.refused(); }

  const ServoStateMachine& states() const { return states_; }
  NavigationState navigation() const { return navigation_; }

 private:
  void hear(std::int64_t now_us);
  CatheterNodeReport answerOf(const XrayFrame& frame, const CArmState& arm, std::int64_t now_us);
  std::optional<std::string> objection(const XrayFrame& frame, const CArmState& arm, std::int64_t now_us);
  void lookForVessels(const XrayFrame& frame, const CArmState& arm, CatheterNodeReport& report);
  void navigate(const XrayFrame& frame, const CArmState& arm, CatheterNodeReport& report);
  bool armHasMoved(const CArmState& arm) const;
  void say(ServoStatus status);

  Bus& bus_;
  CatheterNodeSettings settings_;
  CatheterStage stage_;
  Eigen::Vector3d centroid_;
  LatestValue<XrayFrame> frames_;
  LatestValue<CatheterState> drive_;
  JointHistory joints_;
  HeardRequests requests_;
  Perception perception_;
  Supervisor gates_;
  ServoStateMachine states_;
  FreshnessGate freshness_;
  DriveMonitor motion_;
  CatheterLoop loop_;

  struct Roadmap {
    CArmJoints joints;
    Pose T_patient_model;
    Matrix6d covariance;
    double depth_error;  // Standard deviation of the tree's depth, as a share of it.
  };
  std::optional<Roadmap> roadmap_;
  int believed_ = 0, unseen_ = 0;  // Frames in a row, of a roadmap that is being made.
  bool washed_out_ = false;
  NavigationState navigation_ = NavigationState::kWaiting;
  std::int64_t sequence_ = 0, said_transitions_ = 0;
  ServoStatus last_status_;
};

}  // namespace angio

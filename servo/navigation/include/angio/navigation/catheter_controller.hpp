// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/navigation/catheter_loop.hpp"
#include "angio/navigation/drive_force_limiter.hpp"
#include "angio/navigation/drive_monitor.hpp"
#include "angio/navigation/view_planner.hpp"
#include "angio/perception/gated_perception.hpp"
#include "angio/servo/frame_mailbox.hpp"
#include "angio/servo/safety_supervisor.hpp"

namespace angio::navigation {

/// How a catheter's controller observes and steers.
struct CatheterControllerSettings {
  CatheterLoopSettings loop;
  PerceptionSettings perception;        ///< Of the roadmap.
  RegistrationGateSettings supervisor;  ///< The same: which registrations are used.
  int roadmap_frames = 3;
  static constexpr int washed_out_frames =
      3;  ///< Frames in a row without an accepted one before the catheter alone is sought.
  static constexpr double max_turn_deg = 0.3;        ///< Of the C-arm since the roadmap, above which a new one is made.
  static constexpr double max_shift_error_mm = 0.5;  ///< The same of the table: what an unsure depth makes of its way.
  double max_drive_age_ms = 150;

  bool ask_for_views = false;
  ViewPlannerSettings view;
  static constexpr double view_within_deg = 1;     ///< A requested view is reached when the beam is as near as this ...
  static constexpr double view_within_mm = 5;      ///< ... and the stretch's middle.
  static constexpr double roadmap_patience_s = 8;  ///< In a view without a roadmap, until it is asked for again.

  /// Supervision of the drive; used by a node, not by the controller itself.
  SupervisionSettings safety = forDrive();
  DriveMonitorSettings drive;

  /// A frame that is 200 ms late shows a tip that may have been pushed past a fork since.
  static SupervisionSettings forDrive() {
    SupervisionSettings settings;
    settings.freshness.max_frame_age_ms = 200;
    return settings;
  }

  void visit(SettingsVisitor& v) {
    loop.visit(v);
    v.section("supervisor", [this](SettingsVisitor& s) { supervisor.visit(s); });
    v.integer("roadmap_frames", roadmap_frames, 1, 1000, "Accepted registrations in a row that make a roadmap");
    v.number("max_drive_age_ms", max_drive_age_ms, 1, 10e3,
             "Largest time between a frame and the drive's state that it is read with");
    v.flag("ask_for_views", ask_for_views,
           "The C-arm is asked for the best view of the stretch around the tip (VIEW_REQUEST), and for another when "
           "one is ambiguous; otherwise it stays where it is");
    v.section("view", [this](SettingsVisitor& s) { view.visit(s); });
    safety.visit(v);
    v.section("drive", [this](SettingsVisitor& s) { drive.visit(s); });
  }
};

/// Where the C-arm is, and how the patient lies in it.
struct CArmSetup {
  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical();
  Pose T_dsa_cb = Pose::Identity();                           ///< Calibrated: model frame in the patient frame.
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();  ///< Patient axes L, P, S from the model's axes.
};

/// What became of one frame.
struct CatheterControllerReport {
  CatheterReport loop;                        ///< Of a frame that was searched for the catheter; else at rest.
  CatheterCommand command;                    ///< Proposed, and after commit() as it was sent. At rest while it holds.
  std::optional<std::string> hold_reason;     ///< Why the drive stands still; nothing while it may move.
  bool contradicts = false;                   ///< A sound registration says what cannot be.
  bool roadmap = false;                       ///< The frame was searched for vessels.
  std::optional<PatientObservation> patient;  ///< Where the model is, of a frame that may move the drive.
  /// Where the tree was seen in the frame; or where the roadmap has it, good while the catheter is found along it.
  /// Nothing of a frame that was refused.
  std::optional<RegistrationResult> registration;
  std::optional<ViewRequest> view_request;  ///< The view that is asked for, until it is reached.
  double learning_s = 0;                    ///< Wall time of what was learnt after the command was sent [s].
};

/// Frames of a catheter's intervention become commands for its drive. Knows neither clock nor bus; the same frames and
/// commits give the same commands, bit for bit.
///
/// A roadmap comes first: frames with contrast agent, from which the tree is registered, until the agent has washed
/// out. Then each frame is searched for the catheter along the registered tree. When the C-arm has turned, or the table
/// has gone far, the next roadmap is waited for. With `ask_for_views` a journey begins with a view that it asks for,
/// and the drive rests until the C-arm says that the view is reached.
///
/// Whatever moves the drive goes through a DriveForceLimiter last, with the navigator's `max_force_n`.
class CatheterController {
 public:
  using Input = CatheterInput;
  using Command = CatheterCommand;
  using Report = CatheterControllerReport;

  /// Throws InputError when a setting is out of its range, or a place is none of the tree's.
  CatheterController(const CArmSetup& setup, const VesselTree& tree, const TreeLocation& start,
                     const TreeLocation& target, const CatheterControllerSettings& settings);

  /// Proposes the answer to a frame that was exposed while the arm and the drive were as `input` says. Call commit()
  /// exactly once after each propose() or refuse().
  CatheterControllerReport propose(const XrayFrame& frame, const CatheterInput& input, const ExternalEstimates& = {});

  /// Proposes to stand still for a frame that must not be looked at.
  CatheterControllerReport refuse(const XrayFrame& frame, const std::string& why);

  /// Makes a proposal one to stand still.
  static void withhold(CatheterControllerReport& proposal, const std::string& why);

  /// The command that was sent for the last frame.
  void commit(const CatheterCommand& sent);

  /// What a frame's answer need not wait for: GatedPerception::learn().
  void learn() { perception_.learn(); }

  /// GatedPerception::focalLengthWarning().
  std::optional<std::string> focalLengthWarning() const { return perception_.focalLengthWarning(); }

  /// A catheter's controller estimates everything itself.
  ExternalInputs externalInputs() const { return {}; }

  NavigationState navigation() const { return navigation_; }
  int misses() const { return loop_.navigator().misses(); }  ///< Wrong branches entered, and walls met.
  const TreeTopology& map() const { return loop_.navigator().map(); }
  const CArmGeometry& carm() const { return setup_.carm; }
  const CArmSetup& setup() const { return setup_; }
  const CatheterControllerSettings& settings() const { return settings_; }
  const Eigen::Vector3d& target_model() const { return centroid_; }
  ModelId modelId() const { return perception_.modelId(); }

 private:
  struct Roadmap {
    CArmJoints joints;
    Pose T_patient_model;
    Matrix6d covariance;
    double depth_error;  // Standard deviation of the tree's depth, as a share of it.
  };

  CatheterCommand numbered(const XrayFrame& frame) const;
  std::optional<std::string> rejection(const XrayFrame& frame, const CatheterInput& input) const;
  void forgetRoadmap();
  void planView(const XrayFrame& frame, std::int64_t reached_us);
  void ask(const XrayFrame& frame, const PlannedView& view, const std::string& reason);
  void searchVessels(const XrayFrame& frame, const CArmState& arm, CatheterControllerReport& report);
  void navigate(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive,
                CatheterControllerReport& report);
  bool armHasMoved(const CArmState& arm) const;

  CatheterControllerSettings settings_;
  CArmSetup setup_;
  Eigen::Vector3d centroid_;
  GatedPerception perception_;
  CatheterLoop loop_;
  DriveForceLimiter force_limiter_;
  std::optional<Roadmap> roadmap_;
  int located_frames_ = 0, unseen_frames_ = 0;  // Frames in a row, of a roadmap that is being made.
  bool washed_out_ = false;
  std::optional<ViewPlanner> planner_;  // Nothing where the C-arm stays where it is.
  std::optional<PlannedView> planned_;
  std::optional<ViewRequest> request_;
  std::optional<std::int64_t> view_since_us_;  // When the view that was asked for was reached.
  bool in_doubt_ = false;
  NavigationState navigation_ = NavigationState::kWaiting;
  std::int64_t sequence_ = 0;
};

}  // namespace angio::navigation

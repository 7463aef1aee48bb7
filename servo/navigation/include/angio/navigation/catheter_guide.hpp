// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/messaging/messages.hpp"
#include "angio/navigation/catheter_loop.hpp"
#include "angio/servo/perception.hpp"
#include "angio/servo/supervisor.hpp"

namespace angio {

/// How a catheter's guide looks.
struct CatheterGuideSettings {
  CatheterLoopSettings loop;
  PerceptionSettings perception;     ///< Of the roadmap.
  SupervisorSettings supervisor;     ///< The same: which registrations are believed.
  int roadmap_frames = 3;            ///< Believed registrations in a row that make a roadmap ...
  int washed_out_frames = 3;         ///< ... and frames in a row without one, before the catheter alone is looked for.
  double most_turn_deg = 0.3;        ///< Of the C-arm since the roadmap; more, and another one is needed.
  double most_shift_error_mm = 0.5;  ///< The same, of the table: what the roadmap's unsure depth makes of its way.

  void visit(SettingsVisitor& v) {
    loop.visit(v);
    v.section("supervisor", [this](SettingsVisitor& s) { supervisor.visit(s); });
    v.integer("roadmap_frames", roadmap_frames, 1, 1000);
    v.integer("washed_out_frames", washed_out_frames, 1, 1000);
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
struct CatheterGuideReport {
  CatheterReport loop;              ///< Of a frame that showed the catheter; else at rest.
  CatheterCommand command;          ///< At rest while held.
  std::optional<std::string> held;  ///< Why the drive stands still; nothing while it may move.
  bool roadmap = false;             ///< The frame was looked at for vessels.
  /// Where the tree was seen in the frame; or where the roadmap says that it is, good while the catheter is found
  /// along it. Nothing of a frame that was refused.
  std::optional<RegistrationResult> registration;
};

/// Frames of a catheter's intervention become commands for its drive. Knows neither clock nor bus; the same frames give
/// the same commands, bit for bit.
///
/// A roadmap comes first: frames with contrast agent, from which the tree is registered, until the agent has washed
/// out. Then each frame is looked at for the catheter along the registered tree. When the C-arm has turned, or the
/// table has gone far, the next roadmap is waited for.
class CatheterGuide {
 public:
  /// Throws InputError when a setting is out of its range, or a place is none of the tree's.
  CatheterGuide(const CatheterStage& stage, const VesselTree& tree, const TreePlace& start, const TreePlace& target,
                const CatheterGuideSettings& settings);

  /// Answers a frame that was exposed while the arm and the drive were so.
  CatheterGuideReport step(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive);

  /// Answers a frame that is not to be looked at.
  CatheterGuideReport refuse(const XrayFrame& frame, const std::string& why);

  /// Makes one at rest of an answer that is not to go out.
  static void takeBack(CatheterGuideReport& answer, const std::string& why);

  /// Why a frame must not be looked at, by itself: its image, or joints that are not of its time.
  std::optional<std::string> objection(const XrayFrame& frame, const CArmState& arm) const {
    return gates_.objection(frame, arm);
  }

  NavigationState navigation() const { return navigation_; }
  const TreeMap& map() const { return loop_.navigator().map(); }
  ModelId modelId() const { return perception_.modelId(); }

 private:
  struct Roadmap {
    CArmJoints joints;
    Pose T_patient_model;
    Matrix6d covariance;
    double depth_error;  // Standard deviation of the tree's depth, as a share of it.
  };

  CatheterCommand atRest(const XrayFrame& frame);
  void lookForVessels(const XrayFrame& frame, const CArmState& arm, CatheterGuideReport& report);
  void navigate(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive, CatheterGuideReport& report);
  bool armHasMoved(const CArmState& arm) const;

  CatheterGuideSettings settings_;
  CatheterStage stage_;
  Eigen::Vector3d centroid_;
  Perception perception_;
  Supervisor gates_;
  CatheterLoop loop_;
  std::optional<Roadmap> roadmap_;
  int believed_ = 0, unseen_ = 0;  // Frames in a row, of a roadmap that is being made.
  bool washed_out_ = false;
  NavigationState navigation_ = NavigationState::kWaiting;
  std::int64_t sequence_ = 0;
};

}  // namespace angio

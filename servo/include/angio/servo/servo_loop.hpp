// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "angio/perception/gated_perception.hpp"
#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/servo/frame_mailbox.hpp"
#include "angio/servo/safety_supervisor.hpp"
#include "angio/servo/tasks.hpp"

namespace angio::servo {

/// Everything one loop needs to know. The parts are chosen by the type of their settings.
struct ServoLoopSettings {
  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical();
  Pose T_dsa_cb = Pose::Identity();                           ///< Calibrated: model frame in the patient frame.
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();  ///< Patient axes L, P, S from the model's axes.
  /// The point that matters, within 50 mm of the tree [m]; the tree's centroid.
  std::optional<Eigen::Vector3d> target_model;

  TaskSettings task = ViewTaskSettings{};
  std::optional<ResolveDepthTaskSettings> depth_first;  ///< Before the task, as often as a depth it needs is open.
  ServoLawSettings law = JointSpaceSettings{};
  PerceptionSettings perception;
  RegistrationGateSettings supervisor;
  SafetySettings safety;    ///< Of the machine's permission to move: for a node, the loop itself knows no states.
  double latency_s = 0.08;  ///< From an exposure until its command moves the machine: what tasks look ahead.

  /// Whether frames are registered by another program: then a loop does not observe them itself.
  bool external_registration = false;

  /// What has to be told of each frame, for these settings.
  ExternalInputs externalInputs() const;

  /// What frames are observed with: `perception`, which follows the patient's motion where the task is for a patient
  /// who moves.
  PerceptionSettings perceptionForTask() const;

  /// The same with the gate, for this loop or a node that observes frames for it.
  GatedPerceptionSettings gatedPerception() const;
};

/// Returns the loop's target in this tree, model frame [m]. Throws InputError for one that is too far from it.
Eigen::Vector3d targetOf(const ServoLoopSettings& settings, const VesselTree& tree);

/// What the loop made of one frame.
struct ServoReport {
  CArmCommand command;                        ///< Proposed, and after commit() as it was sent. Zero while it holds.
  std::optional<std::string> hold_reason;     ///< Why it holds; nothing while it servoes.
  bool contradicts = false;                   ///< A sound registration says what cannot be.
  bool observed = false;                      ///< Whether the frame was looked at; one that was refused unseen was not.
  Observation observation;                    ///< Of a frame that was looked at.
  std::optional<PatientObservation> patient;  ///< Where the model is, of a frame that may move the machine.
  TaskAnswer task;                            ///< At rest while it holds.
  ViewProgress view;                          ///< Of a view that another program asks for.
  double control_s = 0;                       ///< Wall time of task, law and limits [s].
  double learning_s = 0;                      ///< Wall time of what was learnt after the command was sent [s].
};

/// One X-ray frame becomes one robot command. Knows neither clock nor bus: the same frames, joints and commits give the
/// same commands, bit for bit.
class ServoLoop {
 public:
  using Input = ServoInput;
  using Command = CArmCommand;
  using Report = ServoReport;

  /// Throws InputError when a setting is out of its range, not finite, or no rotation.
  ServoLoop(const ServoLoopSettings& settings, const VesselTree& tree);

  /// Proposes the answer to a frame that was exposed while the joints were as in `input.state`. Nothing counts as
  /// commanded before commit(): call it exactly once after each propose() or refuse().
  ///
  /// @param external  What ServoLoopSettings::externalInputs() asks for; a frame of which that is missing is held.
  ServoReport propose(const XrayFrame& frame, const ServoInput& input, const ExternalEstimates& external = {});

  /// Proposes to stand still for a frame that must not be looked at.
  ServoReport refuse(const XrayFrame& frame, const std::string& why);

  /// The command that was sent for the last frame: the proposed one, or the same standing still.
  void commit(const CArmCommand& sent);

  /// propose() and commit() in one, for a caller that sends what it is given.
  ServoReport step(const XrayFrame& frame, const CArmState& state, const ExternalEstimates& external = {});

  /// What a frame's answer need not wait for: learns from the frames how the patient moves. To be called after each
  /// frame, when its answer is out; takes some milliseconds now and then.
  void learn();

  /// Makes a proposal one to stand still.
  static void withhold(ServoReport& proposal, const std::string& why);

  ExternalInputs externalInputs() const { return settings_.externalInputs(); }
  const ServoLoopSettings& settings() const { return settings_; }
  const CArmGeometry& carm() const { return settings_.carm; }
  const Eigen::Vector3d& target_model() const { return target_; }
  const Task& task() const { return *task_; }

  /// Where the target was by the frames of a turn, of a task that resolves its depth; nothing before it is known.
  const std::optional<ResolvedDepth>& resolvedDepth() const { return perception_.resolved(); }

  /// GatedPerception::focalLengthWarning().
  std::optional<std::string> focalLengthWarning() const { return perception_.focalLengthWarning(); }

 private:
  double periodUntil(const XrayFrame& frame);
  CArmCommand numbered(const XrayFrame& frame) const;
  std::optional<std::string> rejection(const ExternalEstimates& external) const;
  std::optional<std::string> tipRejection(const ExternalEstimates& external) const;
  std::optional<std::string> rejection(const XrayFrame& frame, const ServoInput& input,
                                       const ExternalEstimates& external);
  void answer(const XrayFrame& frame, const ServoInput& input, const ExternalEstimates& external, double period_s,
              ServoReport& report);
  std::optional<CArmJoints> wantedVelocity(const XrayFrame& frame, const CArmState& state,
                                           const ExternalEstimates& external, double period_s, ServoReport& report);

  ServoLoopSettings settings_;
  Eigen::Vector3d target_;
  std::unique_ptr<Task> task_;
  GatedPerception perception_;  // Observes also the point that the task wants to have observed.
  CArmMotionLimiter limiter_;
  CArmCommand last_command_;
  std::optional<std::int64_t> last_frame_us_;
};

/// The same task without images: the camera is where joints and calibration say. What the loop is compared with.
class OpenLoop {
 public:
  /// Throws InputError as ServoLoop does.
  OpenLoop(const ServoLoopSettings& settings, const VesselTree& tree);

  CArmCommand step(const CArmState& state, double period_s);

  /// Why the last step stood still; nothing while the task has a motion.
  const std::optional<std::string>& holdReason() const { return hold_reason_; }

  const Task& task() const { return *task_; }

 private:
  ServoLoopSettings settings_;
  std::unique_ptr<Task> task_;
  CArmMotionLimiter limiter_;
  CArmCommand last_command_;
  std::optional<std::string> hold_reason_;
};

}  // namespace angio::servo

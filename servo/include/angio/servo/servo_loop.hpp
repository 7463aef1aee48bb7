// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "angio/servo/frame_mailbox.hpp"
#include "angio/servo/perception.hpp"
#include "angio/servo/safety_supervisor.hpp"
#include "angio/servo/supervisor.hpp"
#include "angio/servo/tasks.hpp"

namespace angio {

/// Everything one loop needs to know. The parts are chosen by the type of their settings.
struct ServoLoopSettings {
  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical();
  Pose T_dsa_cb = Pose::Identity();                           ///< Calibrated: model frame in the patient frame.
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();  ///< Patient axes L, P, S from the model's axes.
  std::optional<Eigen::Vector3d> target_model;                ///< The point that matters [m]; the tree's centroid.

  TaskSettings task = ViewTaskSettings{};
  ServoLawSettings law = PositionBasedSettings{};
  PerceptionSettings perception;
  SupervisorSettings supervisor;
  SafetySettings safety;    ///< Of the machine's permission to move: for a node, the loop itself knows no states.
  double latency_s = 0.08;  ///< From an exposure until its command moves the machine: what tasks look ahead.

  /// Whether frames are registered by another program: then a loop does not look at them itself.
  bool registered_elsewhere = false;

  /// What has to be told of each frame, for these settings.
  ToldOfFrames toldOfFrames() const;

  /// What frames are looked at with: `perception`, which follows the patient's motion where the task is for a patient
  /// who moves.
  PerceptionSettings perceptionForTask() const;
};

/// What the loop made of one frame.
struct ServoReport {
  CArmCommand command;              ///< Stands still unless the frame was trusted.
  std::optional<std::string> held;  ///< Why it holds; nothing while it servoes.
  bool tip_unknown = false;         ///< It holds for want of the catheter's tip, of a frame that is sound.
  Sight sight;                      ///< Empty when the frame was not even looked at.
  TaskAnswer task;                  ///< At rest while it holds.
  double control_s = 0;             ///< Wall time of task, law and limits [s].
  double learning_s = 0;            ///< Wall time of what a node learnt when its command was out [s].
};

/// One X-ray frame becomes one robot command. Knows neither clock nor bus: the same frames and joints give the same
/// commands, bit for bit.
class ServoLoop {
 public:
  /// Throws InputError when a setting is out of its range, not finite, or no rotation.
  ServoLoop(const ServoLoopSettings& settings, const VesselTree& tree);

  /// Answers one frame that was exposed while the joints were as in `state`.
  ///
  /// @param seen  What ServoLoopSettings::toldOfFrames() asks for; a frame of which that is missing is held.
  ServoReport step(const XrayFrame& frame, const CArmState& state, const SeenElsewhere& seen = {});

  /// Answers a frame that must not be looked at: the machine stands still.
  ServoReport refuse(const XrayFrame& frame, const std::string& why);

  /// Takes the motion of the last answer back before it goes out: the machine stands still, and the next command begins
  /// from rest.
  void takeBack(ServoReport& last_answer, const std::string& why);

  /// What a frame's answer need not wait for: learns from the frames how the patient moves. To be called after each
  /// frame, when its answer is out; takes some milliseconds now and then.
  void learn();

  const Task& task() const { return *task_; }

 private:
  double periodUntil(const XrayFrame& frame);
  void number(CArmCommand& command, const XrayFrame& frame);
  std::optional<std::string> objection(const SeenElsewhere& seen) const;
  std::optional<std::string> objectionToTip(const SeenElsewhere& seen) const;
  ServoReport answer(const XrayFrame& frame, const CArmState& state, const SeenElsewhere& seen, double period_s);

  ServoLoopSettings settings_;
  std::unique_ptr<Task> task_;
  Perception perception_;  // Watches what the task wants to have seen.
  Supervisor supervisor_;
  CArmCommand last_command_;
  std::optional<std::int64_t> last_frame_us_;
};

/// The same task without eyes: the camera is where joints and calibration say. What the loop is compared with.
class OpenLoop {
 public:
  /// Throws InputError as ServoLoop does.
  OpenLoop(const ServoLoopSettings& settings, const VesselTree& tree);

  CArmCommand step(const CArmState& state, double period_s);

  const Task& task() const { return *task_; }

 private:
  ServoLoopSettings settings_;
  std::unique_ptr<Task> task_;
  Supervisor supervisor_;
  CArmCommand last_command_;
};

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/calibration/view_uncertainty.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/rehearsal/rehearsal_settings.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/simulated_room.hpp"

namespace angio {

/// What really stands there, and what the loop is told of it.
struct RehearsalWorld {
  CArmCalibration truth;     ///< C-arm, X-ray camera and patient.
  CArmCalibration believed;  ///< A calibration's result. Which way the model's axes lie is the model's: the truth's.
};

/// The world that a rehearsal makes up: the patient of `nominal` turned and shifted, the calibration wrong by what the
/// settings say, so that it tilts the view along `beam` [anatomy].
RehearsalWorld madeUpWorld(const VesselTree& tree, const CArmCalibration& nominal, const RehearsalSettings& settings,
                           const ViewAngles& beam);

/// The loop's settings with what the world and its calibration say filled in.
ServoLoopSettings loopIn(const RehearsalWorld& world, const ServoLoopSettings& parts);

/// The room of a world: the C-arm stands where its calibration sees the target along the start's angles. `patient`
/// gets the rehearsal's seed; frames say the camera of the believed C-arm.
SimulatedRoom roomOf(const VesselTree& tree, const RehearsalWorld& world, const RehearsalSettings& settings,
                     const ServoLoopSettings& loop, const SimulatedPatientSettings& patient,
                     const std::optional<RoomCatheter>& catheter = std::nullopt);

/// One frame as the rehearsal's omniscient observer sees it.
struct RehearsalFrame {
  double time_s = 0;
  CArmJoints joints = CArmJoints::Zero();  ///< True, at the exposure.
  CArmCommand command;                     ///< What the loop answered.
  ViewError true_error;                    ///< Of the real view at the exposure; zero for a task without a view.
  Eigen::Vector3d target_camera = Eigen::Vector3d::Zero();  ///< Where the target really was in the camera then [m].
  double target_off_m = 0;  ///< Its image from where the task wants it, as a distance at the isocentre.
  TaskAnswer task;          ///< What the loop believed.
  std::optional<std::string> hold_reason;
  RegistrationStatus status = RegistrationStatus::kTooFewPoints;
  double model_residual_px = 0, image_residual_px = 0;
  int points_2d = 0;
  double render_s = 0, image_s = 0, registration_s = 0, control_s = 0;  ///< Wall time of the stages [s].
  double answer_s = 0;  ///< Wall time from the frame's bytes on the bus to the command's bytes on the bus [s].
};

/// A frame that is kept whole, for the pictures.
struct RehearsalSnapshot {
  XrayFrame frame;
  Centerline2d centerline;
  Pose predicted_T_camera_model = Pose::Identity();  ///< By joints and calibration alone.
  RegistrationResult registration;
};

struct Rehearsal {
  std::vector<RehearsalFrame> closed;  ///< With feedback from the images.
  std::vector<RehearsalFrame> open;    ///< The same task on calibration alone; only time, joints, command, true error.
  ViewError closed_end, open_end;      ///< True view errors at the end.
  bool has_view = false;               ///< Whether the task has a view to reach; else target_off_m is what counts.
  std::optional<ViewUncertainty> predicted;  ///< Of the open loop's end, by the calibration's own records.
  std::optional<RehearsalSnapshot> first, last;
};

/// Called after each frame of the closed loop with the exposure and what the loop made of it.
using RehearsalWatcher = std::function<void(const Exposure&, const ServoReport&, const RehearsalFrame&)>;

/// Called with the arm's true state after each event of the closed loop.
using ArmWatcher = std::function<void(const CArmState&)>;

/// Runs C-arm, X-ray and loop as parties on a bus inside the process, in simulated time; then the same task on
/// calibration alone. The same settings give the same commands, bit for bit. Throws InputError when a setting is out of
/// its range.
Rehearsal rehearse(const VesselTree& tree, const RehearsalWorld& world, const RehearsalSettings& settings,
                   const ServoLoopSettings& parts, const SimulatedPatientSettings& patient,
                   const RehearsalWatcher& watcher = {}, const ArmWatcher& arm_watcher = {});

/// How many frames that will be.
int framesOf(const RehearsalSettings& settings);

}  // namespace angio

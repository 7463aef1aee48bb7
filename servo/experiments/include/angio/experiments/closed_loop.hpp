// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/view_uncertainty.hpp"
#include "angio/experiments/namespace.hpp"
#include "angio/experiments/scenario_settings.hpp"
#include "angio/results/statistics.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/simulated_lab.hpp"

namespace angio::experiments {

/// What really stands there, and what the loop is told of it.
struct Scenario {
  CArmCalibration truth;       ///< C-arm, X-ray camera and patient.
  CArmCalibration calibrated;  ///< A calibration's result. Which way the model's axes lie is the model's: the truth's.
};

/// The world that a closed-loop simulation makes up: the patient of `nominal` turned and shifted, the calibration wrong
/// by what the settings say, so that it tilts the view along `beam` [anatomy].
Scenario randomScenario(const VesselTree& tree, const CArmCalibration& nominal, const ScenarioSettings& settings,
                        const ViewAngles& beam);

/// Two angles [deg], spread evenly over +- these.
Eigen::Vector2d drawnAngles_deg(std::mt19937_64& engine, double max_primary_deg, double max_secondary_deg);

/// Draws a start and a view to go to, puts them into settings, and returns both.
std::pair<ViewAngles, ViewAngles> drawViews(std::mt19937_64& engine, double max_primary_deg, double max_secondary_deg,
                                            ScenarioSettings& scenario, ServoLoopSettings& loop);

/// A calibration for the same detector with another number of pixels a side.
CArmCalibration withDetectorPixels(CArmCalibration calibration, int side_px);

/// The loop's settings with what the world and its calibration say filled in.
ServoLoopSettings loopIn(const Scenario& world, const ServoLoopSettings& parts);

/// The lab of a world: the C-arm stands where its calibration sees the target along the start's angles. `patient`
/// gets the closed-loop simulation's seed; frames say the camera of the believed C-arm.
SimulatedLab labOf(const VesselTree& tree, const Scenario& world, const ScenarioSettings& settings,
                   const ServoLoopSettings& loop, const SimulatedPatientSettings& patient,
                   const std::optional<LabCatheter>& catheter = std::nullopt);

/// One frame as the closed-loop simulation's omniscient observer sees it.
struct ClosedLoopFrame {
  double time_s = 0;
  CArmJoints joints = CArmJoints::Zero();  ///< True, at the exposure.
  CArmCommand command;                     ///< What the loop answered.
  ViewError true_error;                    ///< Of the real view at the exposure; zero for a task without a view.
  Eigen::Vector3d target_camera = Eigen::Vector3d::Zero();  ///< Where the target really was in the camera then [m].
  double target_off_m = 0;        ///< Its image from where the task wants it, as a distance at the isocentre.
  double table_excursion_m = 0;   ///< Of the table from the box of the start and the true goal ...
  double target_excursion_m = 0;  ///< ... and by how much the target was further from its goal than at the start.
  TaskAnswer task;                ///< What the loop believed.
  std::optional<std::string> hold_reason;
  RegistrationStatus status = RegistrationStatus::kTooFewPoints;
  double model_residual_px = 0, image_residual_px = 0;
  int points_2d = 0;
  double render_s = 0, image_s = 0, registration_s = 0, control_s = 0;  ///< Wall time of the stages [s].
  double answer_s = 0;  ///< Wall time from the frame's bytes on the bus to the command's bytes on the bus [s].
};

/// A frame that is kept whole, for the pictures.
struct ClosedLoopSnapshot {
  XrayFrame frame;
  Centerline2d centerline;
  Pose predicted_T_camera_model = Pose::Identity();  ///< By joints and calibration alone.
  RegistrationResult registration;
  Eigen::Matrix3d R_camera_lps = Eigen::Matrix3d::Identity();  ///< Patient axes L, P, S by joints and calibration.
};

/// Frames and ends of one simulated run, in closed and in open loop.
struct ClosedLoopRun {
  std::vector<ClosedLoopFrame> closed;  ///< With feedback from the images.
  std::vector<ClosedLoopFrame> open;    ///< The same task on calibration alone; only time, joints, command, true error.
  ViewError closed_end, open_end;       ///< True view errors at the end.
  double max_table_excursion_m = 0, max_target_excursion_m = 0;  ///< Of the closed loop, between frames too.
  bool has_view = false;  ///< Whether the task has a view to reach; else target_off_m is what counts.
  std::optional<ViewUncertainty> predicted;  ///< Of the open loop's end, by the calibration's own records.
  std::optional<ClosedLoopSnapshot> first, last;
};

/// A view counts as reached, by the truth, while its beam and its target are as near as this.
constexpr double kViewWithin_deg = 0.1, kViewWithin_mm = 0.5;

/// From when on the closed loop's true view was reached and stayed so to the end [s from the first frame]; nothing when
/// it was not at the end.
std::optional<double> settlingTime_s(const ClosedLoopRun& run);

/// Called after each frame of the closed loop with the exposure and what the loop made of it.
using ClosedLoopObserver = std::function<void(const Exposure&, const ServoReport&, const ClosedLoopFrame&)>;

/// Called with the arm's true state after each event of the closed loop.
using ArmWatcher = std::function<void(const CArmState&)>;

/// Runs C-arm, X-ray and loop as parties on a bus inside the process, in simulated time; then the same task on
/// calibration alone. The same settings give the same commands, bit for bit. Throws InputError when a setting is out of
/// its range.
ClosedLoopRun runClosedLoop(const VesselTree& tree, const Scenario& world, const ScenarioSettings& settings,
                            const ServoLoopSettings& parts, const SimulatedPatientSettings& patient,
                            const ClosedLoopObserver& watcher = {}, const ArmWatcher& arm_watcher = {});

/// How many frames that will be.
int framesOf(const ScenarioSettings& settings);

/// Frames, registered, held, a fingerprint of all commands, final errors of both loops, settling time and the way's
/// largest excursions of the closed one, latency p50/p99/max per stage.
Json closedLoopSummary(const ClosedLoopRun& run);

/// The same as a table for people.
std::string closedLoopTable(const Json& summary);

/// One row per frame of the closed loop, with the open loop's error beside it; header with units.
std::string closedLoopTrace(const ClosedLoopRun& run);

/// Writes overlay_first.png, overlay_last.png, plot.png, all three on sheet.jpg, trace.csv and summary.json into
/// `folder`, which exists. `summary` is what summary.json holds. Throws InputError when a file cannot be written.
void writeClosedLoop(const std::string& folder, const ClosedLoopRun& run, const VesselTree& tree, const Json& summary);

}  // namespace angio::experiments

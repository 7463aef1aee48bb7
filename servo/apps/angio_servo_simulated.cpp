// SPDX-License-Identifier: GPL-2.0-or-later
// angio-servo-simulated: what angio-servo --simulate runs, X-ray, C-arm and loop in one process.
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/interruption.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/cli/run_time.hpp"
#include "angio/experiments/closed_loop.hpp"
#include "angio/io/claimed_folder.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/results/experiment.hpp"
#include "angio/results/film_writer.hpp"
#include "angio/results/live_overlay.hpp"
#include "hold_tally.hpp"
#include "servo_program.hpp"

namespace angio::apps {
namespace {

// With a truth, nothing is made up: what would is refused.
Scenario worldOf(const ServoProgramOptions& o, const ServoSettings& settings, const VesselTree& tree,
                 const CArmCalibration& calibration) {
  const ScenarioSettings& scenario = settings.scenario;
  if (o.truth.empty()) {
    // A calibration error is worst where it tilts the view that is to be reached, or else the one that is kept.
    ViewAngles beam{degToRad(scenario.start_primary_deg), degToRad(scenario.start_secondary_deg)};
    const TaskSettings task = settings.tasks.chosen();
    if (const auto* view = std::get_if<ViewTaskSettings>(&task)) {
      beam = {degToRad(view->primary_deg), degToRad(view->secondary_deg)};
      if (view->goal == ViewGoal::kPose) {
        beam = viewAnglesOf(calibration.R_lps_model * view->T_camera_model.linear().row(2).transpose());
      }
    }
    return randomScenario(tree, calibration, scenario, beam);
  }
  const ScenarioSettings usual;
  for (double ScenarioSettings::*made_up :
       {&ScenarioSettings::patient_turn_deg, &ScenarioSettings::patient_shift_mm,
        &ScenarioSettings::calibration_error_deg, &ScenarioSettings::calibration_error_mm}) {
    if (scenario.*made_up == usual.*made_up) continue;
    throw InputError(o.settings, "scenario", "",
                     "patient_* and calibration_error_* must not be given with --truth, which has both");
  }
  return {readCArmCalibration(o.truth, tree), calibration};
}

int simulate(const ServoProgramOptions& o, const ServoSettings& settings, const VesselTree& tree,
             const CArmCalibration& calibration) {
  if (!o.simulate) throw InputError("command line", "--simulate", "", "is needed: this program does nothing else");
  const Scenario world = worldOf(o, settings, tree, calibration);
  const ClaimedFolder claimed(o.out);  // Before the work, not after it.
  std::optional<ProgressBar> bar;
  std::optional<FilmWriter> film;
  if (!o.film.empty()) film.emplace(o.film, settings.scenario.lab.frame_rate_hz);
  LiveOverlay overlay(tree, 768, calibration.carm, calibration.R_patient_lps());
  const ServoLoopSettings loop = settings.loop(calibration);
  const Eigen::Vector3d target = targetOf(loop, tree);
  HoldTally tally;
  const InterruptionGuard guard;  // Given up, a simulation leaves no half of a film.
  const ClosedLoopRun scenario = runClosedLoop(
      tree, world, settings.scenario, loop, settings.patient,
      [&](const Exposure& exposure, const ServoReport& report, const ClosedLoopFrame&) {
        if (!bar) bar.emplace("servoing", framesOf(settings.scenario));
        tally.count(report.hold_reason);
        bar->show(tally.frames());
        if (!film) return;
        film->write(
            overlay.draw({exposure.frame, registrationMessage(report), servoStatus(report), std::nullopt,
                          exposure.state, target, "task " + nameOf(loop.task)}));
      });
  bar.reset();
  if (film) film->finish();
  auto summary = closedLoopSummary(scenario);
  summary["seed"] = settings.scenario.seed;
  if (loop.target_model) summary["target_mm"] = o.loop.target_mm;
  summary["settings"] = settingsAsJson(settings);
  if (!o.patient.deformation_field.empty()) summary["deformation_field"] = o.patient.deformation_field;
  summary["machine"] = machineAsJson();
  writeClosedLoop(o.out, scenario, tree, summary);
  std::cout << closedLoopTable(summary) << "\nPictures, trace.csv and summary.json are in " << o.out << "/\n";
  const auto never_moved = tally.neverMoved();
  if (never_moved) std::cerr << "angio-servo: " << *never_moved << "\n";
  return never_moved ? kExitNotReached : 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) { return angio::apps::runServoProgram(argc, argv, {}, angio::apps::simulate); }

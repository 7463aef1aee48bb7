// SPDX-License-Identifier: GPL-2.0-or-later
#include "servo_program.hpp"
#include "angio/cli/further_options.hpp"
#include "angio/cli/program.hpp"

#include <iostream>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/imaging/wide_vessels.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "centered_option.hpp"

namespace angio::apps {

void ServoProgramOptions::addTo(cli::Command& app) {
  const ServoSettings defaults;
  auto* simulated =
      app.addFlag("--simulate", simulate, "Simulated X-ray, C-arm and loop in one process, in simulated time");
  app.addOption("--bus", bus, cli::busHelp("Bus to listen on when not simulating"))->excludes(simulated);
  app.addFlag("--wait-for-operator", wait_for_operator,
              "Stand still until SERVO_REQUEST arms and starts (angio-operator): the default on a bus")
      ->excludes(simulated);
  app.addFlag("--autostart", autostart,
              "Arm and start at once, without an operator: for simulations and tests, as --simulate does")
      ->excludes("--wait-for-operator");
  app.addOption("--record", record,
                "Log of all that is heard and said (.lcm; .mcap, for Foxglove too), for angio-replay")
      ->excludes(simulated);
  app.addFlag("--point-covariance", point_covariance,
              "Say of each frame also how uncertain each point of the tree is: REGISTRATION_POINTS")
      ->excludes(simulated)
      ->group(cli::kFurtherOptions);
  app.addOption("--tree", tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.addOption("--calibration", calibration,
                "C-arm geometry and T_dsa_cb (.yaml); when simulating without --truth, what is made wrong");
  auto* centered = addCenteredOption(app, t_dsa_cb)->needs(simulated);
  app.addOption(
         "--truth", truth,
         "The simulated C-arm and patient (.yaml), of angio-calibrate simulate; --calibration is what is believed")
      ->needs(simulated)
      ->excludes(centered)
      ->group(cli::kFurtherOptions);
  app.addOption("--machine", machine, "The C-arm that is to be moved: a calibration of another one is refused")
      ->group(cli::kFurtherOptions);
  app.addOption("--max-calibration-age-days", max_age_days, "An older calibration is warned of")
      ->check(between(0, 1e6))
      ->group(cli::kFurtherOptions);
  app.addOption("--disturb", disturb, "What happens to commands on their way (.yaml): loss, delay, jitter, ...")
      ->excludes(simulated)
      ->group(cli::kFurtherOptions);
  app.addOption("--key-file", key_file, cli::kKeyFileHelp)->excludes(simulated)->group(cli::kFurtherOptions);
  loop.addTo(app);
  app.addOption("--view-pose", view_pose, "Desired view: as in a registered pose (.yaml), of angio-register --out-pose")
      ->excludes("--view-primary-deg")
      ->excludes("--view-secondary-deg");
  app.addOption("--preview", preview,
                "Folder for the planned trajectory, as a picture and numbers: from the simulation's start, or from "
                "where the machine on the bus stands; moves nothing")
      ->group(cli::kFurtherOptions);
  app.addOption("--duration-s", duration_s, "How long; 0: the settings' time when simulating, else until stopped")
      ->check(between(0, 86400))
      ->defaultText("0");
  app.addOption("--seed", seed, "Seed of the simulation")
      ->check(cli::wholeBetween(0, 2147483647))
      ->defaultText(std::to_string(defaults.scenario.seed));
  patient.addTo(app, simulated);
  addSettingsOptions(app, settings, "Settings (.yaml), sections by part", servoSettingsAsYaml);
  app.addOption("--film", film, "Film of a simulation (.mp4, or numbered pictures, frames/%04d.png)")->needs(simulated);
  app.addOption("--out", out, "Folder for pictures, trace.csv and summary.json of a simulation");
}

ServoSettings ServoProgramOptions::effectiveSettings() const {
  ServoSettings effective = readServoSettings(settings);
  loop.applyTo(effective);
  patient.applyTo(effective.patient);
  effective.scenario.seed = seed.value_or(effective.scenario.seed);
  ViewTaskSettings& view = effective.tasks.of<ViewTaskSettings>();
  if (!view_pose.empty()) {
    view.goal = ViewGoal::kPose;
    view.T_camera_model = readPose(view_pose).T_camera_model;
  } else if (view.goal == ViewGoal::kPose) {
    throw InputError(settings, "view.goal", "pose", "needs --view-pose");
  }
  if (duration_s.value_or(0) > 0) effective.scenario.duration_s = *duration_s;
  return effective;
}

CArmCalibration ServoProgramOptions::readCalibration(const VesselTree& model) const {
  const CArmCalibration read = apps::readCalibration("angio-servo", calibration, t_dsa_cb, model);
  const std::string moved = truth.empty() ? machine : readCArmFile(truth).machine;
  for (const auto& warning : checkRecords(calibration, read.records, {moved, max_age_days})) {
    std::cerr << "angio-servo: " << warning << "\n";
  }
  if (!moved.empty() && !read.machine.empty() && read.machine != moved) {
    throw InputError(calibration, "machine", read.machine, "must be the one that is to be moved, " + moved);
  }
  return read;
}

namespace {

// At the arm's rest: from where it looks changes how wide a vessel is by little.
void warnOfWideVessels(const ServoSettings& settings, const VesselTree& tree, const CArmCalibration& calibration) {
  const Pose T_camera_model = calibration.carm.T_camera_patient(CArmJoints::Zero()) * calibration.T_dsa_cb;
  const auto wide = tooWideVessels(tree, calibration.carm.camera(), T_camera_model, settings.extractors.chosen());
  if (wide) std::cerr << "angio-servo: " << *wide << "\n";
}

}  // namespace

int runServoProgram(int argc, char** argv, const std::function<int()>& simulated, const ServoWork& work) {
  cli::Command app("Drives a C-arm to a view of the anatomy by what its X-ray images show.", "angio-servo");
  describeProgram(app, "angio-servo --simulate --seed 3 --out demo-output");
  ServoProgramOptions options;
  options.addTo(app);
  return runProgram(app, argc, argv, [&] {
    if (options.simulate && simulated && options.preview.empty()) return simulated();
    const ServoSettings settings = options.effectiveSettings();
    const VesselTree tree = readVesselTree(options.tree);
    if (!options.view_pose.empty()) requireTree(options.view_pose, readPose(options.view_pose).model_id, tree);
    const CArmCalibration calibration = options.readCalibration(tree);
    warnOfWideVessels(settings, tree, calibration);
    return work(options, settings, tree, calibration);
  });
}

}  // namespace angio::apps

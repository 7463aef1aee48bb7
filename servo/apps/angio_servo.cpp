// SPDX-License-Identifier: GPL-2.0-or-later
// angio-servo: drives a C-arm to a view of the anatomy by what its X-ray images show.
#include <csignal>
#include <iostream>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/base/monotonic_clock.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/evaluation/film_writer.hpp"
#include "angio/evaluation/live_overlay.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/rehearsal/rehearsal_report.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/servo_node.hpp"
#include "disturbance.hpp"
#include "loop_options.hpp"
#include "run_log.hpp"

namespace angio {
namespace {

struct Options {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string bus = "udpm://239.255.76.67:7667?ttl=0", settings, out = "demo-output";
  LoopOptions loop;
  std::optional<double> duration_s;  // Given, it comes before the settings file's.
  std::optional<int> seed;
  std::string film, truth, machine, record, disturb, view_pose;
  double largest_age_days = RecordGate().largest_age_days;
  bool simulate = false, wait_for_operator = false;
};

ServoSettings effectiveSettings(const Options& o) {
  ServoSettings settings = readServoSettings(o.settings);
  o.loop.applyTo(settings);
  settings.rehearsal.seed = o.seed.value_or(settings.rehearsal.seed);
  ViewTaskSettings& view = settings.tasks.of<ViewTaskSettings>();
  if (!o.view_pose.empty()) {
    view.goal = ViewGoal::kPose;
    view.T_camera_model = readPose(o.view_pose).T_camera_model;
  } else if (view.goal == ViewGoal::kPose) {
    throw InputError(o.settings, "view.goal", "pose", "needs --view-pose");
  }
  if (o.duration_s.value_or(0) > 0) settings.rehearsal.duration_s = *o.duration_s;
  return settings;
}

// Takes a calibration only from the machine that is to be moved, and says when it is old.
CArmCalibration readCalibration(const Options& o) {
  const CArmCalibration calibration = readCArmCalibration(o.calibration);
  const std::string machine = o.truth.empty() ? o.machine : readCArmFile(o.truth).machine;
  for (const auto& warning : checkRecords(o.calibration, calibration.records, {machine, o.largest_age_days})) {
    std::cerr << "angio-servo: " << warning << "\n";
  }
  if (!machine.empty() && !calibration.machine.empty() && calibration.machine != machine) {
    throw InputError(o.calibration, "machine", calibration.machine, "must be the one that is to be moved, " + machine);
  }
  return calibration;
}

// With a truth, nothing is made up: what would is refused.
RehearsalWorld worldOf(const Options& o, const ServoSettings& settings, const VesselTree& tree,
                       const CArmCalibration& calibration) {
  const RehearsalSettings& rehearsal = settings.rehearsal;
  if (o.truth.empty()) {
    // A calibration error is worst where it tilts the view that is to be reached, or else the one that is kept.
    ViewAngles beam{degToRad(rehearsal.start_primary_deg), degToRad(rehearsal.start_secondary_deg)};
    const TaskSettings task = settings.tasks.chosen();
    if (const auto* view = std::get_if<ViewTaskSettings>(&task)) {
      beam = {degToRad(view->primary_deg), degToRad(view->secondary_deg)};
      if (view->goal == ViewGoal::kPose) {
        beam = viewAnglesOf(calibration.R_lps_model * view->T_camera_model.linear().row(2).transpose());
      }
    }
    return madeUpWorld(tree, calibration, rehearsal, beam);
  }
  const RehearsalSettings usual;
  for (double RehearsalSettings::*made_up :
       {&RehearsalSettings::patient_turn_deg, &RehearsalSettings::patient_shift_mm,
        &RehearsalSettings::calibration_error_deg, &RehearsalSettings::calibration_error_mm}) {
    if (rehearsal.*made_up == usual.*made_up) continue;
    throw InputError(o.settings, "rehearsal", "",
                     "patient_* and calibration_error_* must not be given with --truth, which has both");
  }
  return {readCArmCalibration(o.truth), calibration};
}

int simulate(const Options& o, const ServoSettings& settings, const VesselTree& tree,
             const CArmCalibration& calibration) {
  const RehearsalWorld world = worldOf(o, settings, tree, calibration);
  makeFolder(o.out);  // Before the work, not after it.
  std::optional<ProgressBar> bar;
  std::optional<FilmWriter> film;
  if (!o.film.empty()) film.emplace(o.film, settings.rehearsal.room.frame_rate_hz);
  LiveOverlay overlay(tree);
  const ServoLoopSettings loop = settings.loop(calibration);
  int done = 0;
  const Rehearsal rehearsal =
      rehearse(tree, world, settings.rehearsal, loop, settings.patient,
               [&](const Exposure& exposure, const ServoReport& report, const RehearsalFrame&) {
                 if (!bar) bar.emplace("servoing", framesOf(settings.rehearsal));
                 bar->show(++done);
                 if (!film) return;
                 film->write(overlay.draw({exposure.frame, registrationMessage(report), servoStatus(report),
                                           std::nullopt, exposure.state, loop.target_model.value_or(tree.centroid()),
                                           "task " + nameOf(loop.task)}));
               });
  bar.reset();
  if (film) film->finish();
  auto summary = rehearsalSummary(rehearsal);
  summary["seed"] = settings.rehearsal.seed;
  summary["settings"] = settingsAsJson(settings);
  summary["machine"] = machineAsJson();
  writeRehearsal(o.out, rehearsal, tree, summary);
  std::cout << rehearsalTable(summary) << "\nPictures, trace.csv and summary.json are in " << o.out << "/\n";
  return 0;
}

volatile std::sig_atomic_t stopped = 0;

// Listens until it is stopped; the arm's side stops by itself when no more commands come.
int serve(const Options& o, const ServoSettings& settings, const VesselTree& tree, const CArmCalibration& calibration) {
  const ServoLoopSettings loop = settings.loop(calibration);
  const auto bus = openSharedBus(o.bus, o.disturb);
  if (const auto warning = receiveBufferWarning(o.bus)) std::cerr << "angio-servo: " << *warning << "\n";
  RunLog log(*bus, o.record, "angio-servo");
  ServoNode node(log.bus(), loop, tree);
  Operator starter(log.bus());
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  const double duration_s = o.duration_s.value_or(0);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(duration_s);
  std::int64_t frames = 0, held = 0;
  while (!stopped && (duration_s <= 0 || std::chrono::steady_clock::now() < end)) {
    bus->handle(std::chrono::milliseconds(20));
    const std::int64_t now_us = monotonic_us();
    if (!o.wait_for_operator) starter.start(now_us);
    const auto report = node.answer(now_us);
    log.watch();
    if (!report) continue;
    ++frames;
    held += report->hold_reason.has_value();
    if (report->hold_reason)
      std::cerr << "frame " << report->command.frame_sequence << " held: " << *report->hold_reason << "\n";
  }
  std::cout << frames << " frames answered, " << held << " held, " << node.refused() << " messages refused\n";
  log.finish();
  return 0;
}

}  // namespace
}  // namespace angio

int main(int argc, char** argv) {
  CLI::App app("Drives a C-arm to a view of the anatomy by what its X-ray images show.", "angio-servo");
  angio::describeProgram(app, "angio-servo --simulate --seed 3 --out demo-output");
  using angio::between;
  const angio::ServoSettings defaults;
  angio::Options o;
  auto* simulated =
      app.add_flag("--simulate", o.simulate, "Simulated X-ray, C-arm and loop in one process, in simulated time");
  app.add_option("--bus", o.bus, "Bus to listen on (LCM URL) when not simulating")->excludes(simulated);
  app.add_flag("--wait-for-operator", o.wait_for_operator,
               "Stand still until SERVO_REQUEST arms and starts (angio-operator); else armed and started at once")
      ->excludes(simulated);
  app.add_option("--record", o.record, "Log of all that is heard and said (.lcm), for angio-replay")
      ->excludes(simulated);
  app.add_option("--tree", o.tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  app.add_option("--calibration", o.calibration,
                 "C-arm geometry and T_dsa_cb (.yaml); when simulating without --truth, what is made wrong");
  app.add_option(
         "--truth", o.truth,
         "The simulated C-arm and patient (.yaml), of angio-calibrate simulate; --calibration is what is believed")
      ->needs(simulated);
  app.add_option("--machine", o.machine, "The C-arm that is to be moved: a calibration of another one is refused");
  app.add_option("--largest-calibration-age-days", o.largest_age_days, "An older calibration is warned of")
      ->check(between(0, 1e6));
  app.add_option("--disturb", o.disturb, "What happens to commands on their way (.yaml): loss, delay, jitter, ...")
      ->excludes(simulated);
  o.loop.addTo(app);
  app.add_option("--view-pose", o.view_pose,
                 "Desired view: as in a registered pose (.yaml), of angio-register --out-pose")
      ->excludes("--view-primary-deg")
      ->excludes("--view-secondary-deg");
  app.add_option("--duration-s", o.duration_s, "How long; 0: the settings' time when simulating, else until stopped")
      ->check(between(0, 86400))
      ->default_str("0");
  app.add_option("--seed", o.seed, "Seed of the simulation")
      ->check(CLI::Range(0, 2147483647))
      ->default_str(std::to_string(defaults.rehearsal.seed));
  app.add_option("--settings", o.settings, "Settings (.yaml), sections by part");
  app.add_option("--film", o.film, "Film of a simulation (.mp4, or numbered pictures, frames/%04d.png)")
      ->needs(simulated);
  app.add_option("--out", o.out, "Folder for pictures, trace.csv and summary.json of a simulation");
  return angio::runProgram(app, argc, argv, [&] {
    const angio::ServoSettings settings = angio::effectiveSettings(o);
    const angio::VesselTree tree = angio::readVesselTree(o.tree);
    const angio::CArmCalibration calibration = angio::readCalibration(o);
    return o.simulate ? angio::simulate(o, settings, tree, calibration) : angio::serve(o, settings, tree, calibration);
  });
}

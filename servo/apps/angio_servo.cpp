// SPDX-License-Identifier: GPL-2.0-or-later
// angio-servo: drives a C-arm to a view of the anatomy by what its X-ray images show.
#include <csignal>
#include <iostream>
#include <optional>

#include "angio/base/errors.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/imaging/extractor_sections.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/rehearsal/rehearsal_report.hpp"

namespace angio {
namespace {

struct Options {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string bus = "udpm://239.255.76.67:7667?ttl=0", settings, out = "demo-output";
  std::optional<double> view_primary_deg, view_secondary_deg,
      duration_s;  // Given ones come before the settings file's.
  std::optional<int> seed;
  std::string truth, machine;
  double largest_age_days = RecordGate().largest_age_days;
  bool simulate = false;
};

enum class LoopMethod { kOrientedKernel, kIterativePnp };

// The loop's parts as the settings file may change them.
struct Settings {
  RehearsalSettings rehearsal;
  FluoroscopySettings fluoroscopy;
  ExtractorSections extractors{ServoLoopSettings().extractor};
  LoopMethod method = LoopMethod::kOrientedKernel;
  OrientedKernelSettings oriented_kernel;
  IterativePnpSettings search =
      ServoLoopSettings::iterativePnpForSearch();  // Of iterative_pnp, while nothing is tracked,
  IterativePnpSettings tracking = ServoLoopSettings::iterativePnpForTracking();  // and from frame to frame.
  int starts = 0;
  PatientTrackerSettings tracker;
  PositionBasedSettings position_based;
  SupervisorSettings supervisor;

  void visit(SettingsVisitor& v) {
    const auto section = [&v](const char* key, auto& settings) {
      v.section(key, [&](SettingsVisitor& inner) { settings.visit(inner); });
    };
    section("rehearsal", rehearsal);
    section("fluoroscopy", fluoroscopy);
    extractors.visit(v);
    v.choice("method", method, {OrientedKernelSettings::kName, IterativePnpSettings::kName});
    v.integer("starts", starts, 0, 100000);
    section(OrientedKernelSettings::kName, oriented_kernel);
    v.section(IterativePnpSettings::kName, [&](SettingsVisitor& inner) {
      inner.section("search", [&](SettingsVisitor& s) { search.visit(s); });
      inner.section("tracking", [&](SettingsVisitor& s) { tracking.visit(s); });
    });
    section("tracker", tracker);
    section(PositionBasedSettings::kName, position_based);
    section("supervisor", supervisor);
  }

  ServoLoopSettings loop() const {
    ServoLoopSettings loop;
    loop.extractor = extractors.chosen();
    loop.search = loop.tracking = oriented_kernel;
    if (method == LoopMethod::kIterativePnp) {
      loop.useIterativePnp();
      loop.search = search;
      loop.tracking = tracking;
    }
    if (starts > 0) loop.search_starts.count = starts;
    loop.tracker = tracker;
    loop.law = position_based;
    loop.supervisor = supervisor;
    return loop;
  }
};

Settings effectiveSettings(const Options& o) {
  Settings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  RehearsalSettings& r = settings.rehearsal;
  r.seed = o.seed.value_or(r.seed);
  r.view_primary_deg = o.view_primary_deg.value_or(r.view_primary_deg);
  r.view_secondary_deg = o.view_secondary_deg.value_or(r.view_secondary_deg);
  if (o.duration_s.value_or(0) > 0) r.duration_s = *o.duration_s;
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
RehearsalWorld worldOf(const Options& o, const RehearsalSettings& rehearsal, const VesselTree& tree,
                       const CArmCalibration& calibration) {
  if (o.truth.empty()) return madeUpWorld(tree, calibration, rehearsal);
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

int simulate(const Options& o, const Settings& settings, const VesselTree& tree, const CArmCalibration& calibration) {
  const RehearsalWorld world = worldOf(o, settings.rehearsal, tree, calibration);
  makeFolder(o.out);  // Before the work, not after it.
  std::optional<ProgressBar> bar;
  const Rehearsal rehearsal =
      rehearse(tree, world, settings.rehearsal, settings.loop(), settings.fluoroscopy, [&](int done, int total) {
        if (!bar) bar.emplace("servoing", total);
        bar->show(done);
      });
  bar.reset();
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
int serve(const Options& o, const Settings& settings, const VesselTree& tree, const CArmCalibration& calibration) {
  ServoLoopSettings loop = settings.loop();
  loop.carm = calibration.carm;
  loop.T_dsa_cb = calibration.T_dsa_cb;
  loop.view = {{degToRad(settings.rehearsal.view_primary_deg), degToRad(settings.rehearsal.view_secondary_deg)},
               tree.centroid(),
               calibration.R_lps_model};
  const auto bus = openBus(o.bus);
  ServoNode node(*bus, loop, tree);
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  const double duration_s = o.duration_s.value_or(0);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(duration_s);
  std::int64_t frames = 0, held = 0;
  while (!stopped && (duration_s <= 0 || std::chrono::steady_clock::now() < end)) {
    bus->handle(std::chrono::milliseconds(100));
    const auto report = node.answer();
    if (!report) continue;
    ++frames;
    held += report->held.has_value();
    if (report->held) std::cerr << "frame " << report->command.frame_sequence << " held: " << *report->held << "\n";
  }
  std::cout << frames << " frames answered, " << held << " held, " << node.refused() << " messages refused\n";
  return 0;
}

}  // namespace
}  // namespace angio

int main(int argc, char** argv) {
  CLI::App app("Drives a C-arm to a view of the anatomy by what its X-ray images show.", "angio-servo");
  angio::describeProgram(app, "angio-servo --simulate --seed 3 --out demo-output");
  using angio::between, angio::shown;
  const angio::RehearsalSettings defaults;
  angio::Options o;
  auto* simulated =
      app.add_flag("--simulate", o.simulate, "Simulated X-ray, C-arm and loop in one process, in simulated time");
  app.add_option("--bus", o.bus, "Bus to listen on (LCM URL) when not simulating")->excludes(simulated);
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
  app.add_option("--view-primary-deg", o.view_primary_deg, "Desired view of the anatomy: LAO positive, RAO negative")
      ->check(between(-110, 110))
      ->default_str(shown(defaults.view_primary_deg));
  app.add_option("--view-secondary-deg", o.view_secondary_deg,
                 "Desired view of the anatomy: CRA positive, CAU negative")
      ->check(between(-55, 55))
      ->default_str(shown(defaults.view_secondary_deg));
  app.add_option("--duration-s", o.duration_s, "How long; 0: the settings' time when simulating, else until stopped")
      ->check(between(0, 86400))
      ->default_str("0");
  app.add_option("--seed", o.seed, "Seed of the simulation")
      ->check(CLI::Range(0, 2147483647))
      ->default_str(std::to_string(defaults.seed));
  app.add_option("--settings", o.settings, "Settings (.yaml), sections by part");
  app.add_option("--out", o.out, "Folder for pictures, trace.csv and summary.json of a simulation");
  return angio::runProgram(app, argc, argv, [&] {
    const angio::Settings settings = angio::effectiveSettings(o);
    const angio::VesselTree tree = angio::readVesselTree(o.tree);
    const angio::CArmCalibration calibration = angio::readCalibration(o);
    return o.simulate ? angio::simulate(o, settings, tree, calibration) : angio::serve(o, settings, tree, calibration);
  });
}

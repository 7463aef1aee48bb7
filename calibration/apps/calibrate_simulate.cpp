// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate simulate: a set of calibration data with known truth.
#include <cmath>
#include <iostream>
#include <map>
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/experiment.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/statistics.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "calibrate.hpp"

namespace angio::apps {
namespace {

struct SimulateOptions {
  std::string out, settings;
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), nominal = exampleDataFile("hepatic-tace/carm.yaml");
  std::optional<int> seed;
  std::optional<SimulatedDistortion> distortion;
  std::optional<HostileData> hostile;
  std::optional<int> camera_views, geometry_views, poses;
  std::optional<double> noise_px, missing, flex_mm;
  SimulatedImages images = SimulatedImages::kCamera;
  std::string experiment;
  int trials = 200;
};

CalibrationSimulationSettings effectiveSettings(const SimulateOptions& o) {
  CalibrationSimulationSettings s;
  if (!o.settings.empty()) s = readSettings(o.settings, s);
  s.seed = o.seed.value_or(s.seed);
  s.distortion = o.distortion.value_or(s.distortion);
  s.hostile = o.hostile.value_or(s.hostile);
  s.camera_views = o.camera_views.value_or(s.camera_views);
  s.geometry_views = o.geometry_views.value_or(s.geometry_views);
  s.hand_eye_poses = o.poses.value_or(s.hand_eye_poses);
  s.bead_noise_px = o.noise_px.value_or(s.bead_noise_px);
  s.missing_beads = o.missing.value_or(s.missing_beads);
  if (o.flex_mm) {
    s.flex_deg *= *o.flex_mm / s.flex_mm;
    s.flex_mm = *o.flex_mm;
  }
  return s;
}

int simulate(const SimulateOptions& o) {
  const CalibrationSimulationSettings settings = effectiveSettings(o);
  const VesselTree tree = readVesselTree(o.tree);
  std::optional<ProgressBar> bar;
  writeCalibrationData(o.out, readCArmCalibration(o.nominal), tree.centroid(), settings, o.images,
                       [&](int done, int total) {
                         if (!bar) bar.emplace("rendering", total);
                         bar->show(done);
                       });
  bar.reset();
  std::cout << settings.camera_views << " views for the camera, " << settings.geometry_views << " for the geometry and "
            << settings.hand_eye_poses << " poses of the anatomy are in " << o.out << "/, their truth in " << o.out
            << "/truth/carm.yaml\n";
  return 0;
}

// Mean of squared errors by the covariance, and where it lies in 95 of 100 studies when the covariance is right.
std::string neesRow(const std::string& name, const std::vector<double>& nees, double freedom) {
  double mean = 0;
  for (const double x : nees) mean += x / static_cast<double>(nees.size());
  const double half = 1.96 * std::sqrt(2 * freedom / static_cast<double>(nees.size()));
  return formatted("%-44s %8.3f   (95 %% band %.3f to %.3f)\n", name.c_str(), mean, freedom - half, freedom + half);
}

std::string percentilesRow(const std::string& name, const std::vector<double>& values) {
  return formatted("%-44s %8.4f %8.4f %8.4f\n", name.c_str(), percentile(values, 0.5), percentile(values, 0.95),
                   percentile(values, 1));
}

template <typename Trial, typename Value>
std::vector<double> valuesOf(const std::vector<Trial>& trials, const Value& value) {
  std::vector<double> values;
  for (const Trial& trial : trials) values.push_back(value(trial));
  return values;
}

std::string cameraTable(const std::vector<CameraTrial>& trials) {
  return formatted("%-44s %8s %8s %8s\n", "", "median", "95 %", "worst") +
         percentilesRow("reprojection rms [px]", valuesOf(trials, [](const auto& t) { return t.rms_px; })) +
         percentilesRow("source position, seen from the phantom [mm]",
                        valuesOf(trials, [](const auto& t) { return 1e3 * t.source_m; })) +
         neesRow("NEES, principal point (2)", valuesOf(trials, [](const auto& t) { return t.principal_point_nees; }),
                 2) +
         neesRow("NEES, fx, fy, cx, cy (4)", valuesOf(trials, [](const auto& t) { return t.camera_nees; }), 4);
}

std::string geometryTable(const std::vector<GeometryTrial>& trials, bool bends) {
  std::string table =
      formatted("%-44s %8s %8s %8s\n", "", "median", "95 %", "worst") +
      percentilesRow("beam's direction, other positions [deg]",
                     valuesOf(trials, [](const auto& t) { return radToDeg(t.direction_rad); })) +
      percentilesRow("phantom's middle, other positions [mm]",
                     valuesOf(trials, [](const auto& t) { return 1e3 * t.target_m; })) +
      percentilesRow("residual rms, rigid arm [px]", valuesOf(trials, [](const auto& t) { return t.rms_rigid_px; })) +
      percentilesRow("residual rms, arm that bends [px]", valuesOf(trials, [](const auto& t) { return t.rms_px; }));
  if (bends) return table;  // Bending that no model has is in the arm's numbers, too.
  return table + neesRow(formatted("NEES, %d numbers of the arm", trials[0].numbers),
                         valuesOf(trials, [](const auto& t) { return t.nees * t.numbers; }), trials[0].numbers);
}

int experiment(const SimulateOptions& o) {
  CalibrationSimulationSettings settings = effectiveSettings(o);
  const CArmCalibration nominal = readCArmCalibration(o.nominal);
  if (o.experiment == "timing") {
    settings.camera_views = o.camera_views.value_or(120);
    settings.geometry_views = o.geometry_views.value_or(120);
    const CalibrationTimes times = calibrationTimes(nominal, settings);
    std::cout << formatted("camera, %d views: %.3f s\ngeometry, %d views: %.3f s (one thread, quickest of three)\n",
                           settings.camera_views, times.camera_s, settings.geometry_views, times.geometry_s);
    return 0;
  }
  std::cout << o.trials << " trials, " << settings.bead_noise_px << " px bead noise\n";
  if (o.experiment == "camera") {
    ProgressBar bar("calibrating", o.trials);
    const auto trials = cameraExperiment(nominal, settings, o.trials, [&](int done) { bar.show(done); });
    std::cout << "camera, " << settings.camera_views << " views\n" << cameraTable(trials);
    return 0;
  }
  for (const bool bends : {false, true}) {
    CalibrationSimulationSettings s = settings;
    if (!bends) s.flex_mm = s.flex_deg = 0;
    ProgressBar bar("calibrating", o.trials);
    const auto trials = geometryExperiment(nominal, s, o.trials, [&](int done) { bar.show(done); });
    std::cout << "\ngeometry, " << s.geometry_views << " views, an arm that "
              << (bends ? "bends as no model does\n" : "is rigid\n") << geometryTable(trials, bends);
  }
  return 0;
}

template <typename Value>
void addChoice(CLI::App& command, const std::string& name, std::optional<Value>& value, const std::string& about,
               const std::map<std::string, Value>& choices, const std::string& usual) {
  command.add_option(name, value, about)->transform(CLI::CheckedTransformer(choices))->default_str(usual);
}

}  // namespace

void addCalibrateSimulate(CLI::App& app, Work& work) {
  const auto o = std::make_shared<SimulateOptions>();
  const CalibrationSimulationSettings usual;
  auto* command = app.add_subcommand("simulate", "Write calibration data of a simulated C-arm, with their truth");
  command->option_defaults()->always_capture_default();
  command->footer(
      "Examples:\n  angio-calibrate simulate --out calibration --seed 3\n"
      "  angio-calibrate simulate --study camera --trials 200");
  auto* out = command->add_option("--out", o->out, "Folder");
  command
      ->add_option(
          "--study", o->experiment,
          "No files: calibrate simulated machines and print errors against the truth: camera, geometry, timing")
      ->check(CLI::IsMember({"camera", "geometry", "timing"}))
      ->excludes(out);
  command->add_option("--trials", o->trials, "Of a study")->check(CLI::Range(1, 100000));
  command->add_option("--seed", o->seed, "Seed of machine, patient and noise")
      ->check(CLI::Range(0, 2147483647))
      ->default_str(std::to_string(usual.seed));
  command->add_option("--tree", o->tree, "Vessel tree of the patient");
  command->add_option("--nominal", o->nominal, "The C-arm and patient that are drawn around (.yaml)");
  const std::map<std::string, SimulatedImages> images{
      {"none", SimulatedImages::kNone}, {"camera", SimulatedImages::kCamera}, {"all", SimulatedImages::kAll}};
  command->add_option("--images", o->images, "Which views are X-ray images, not tables of beads: none, camera, all")
      ->transform(CLI::CheckedTransformer(images))
      ->default_str("camera");
  addChoice<SimulatedDistortion>(*command, "--distortion", o->distortion, "Of the detector: none, radial, intensifier",
                                 {{"none", SimulatedDistortion::kNone},
                                  {"radial", SimulatedDistortion::kRadial},
                                  {"intensifier", SimulatedDistortion::kIntensifier}},
                                 "none");
  addChoice<HostileData>(*command, "--hostile", o->hostile,
                         "Data to be refused: duplicate-poses, swapped-beads, wrong-units, mirrored-phantom, "
                         "other-machine",
                         {{"none", HostileData::kNone},
                          {"duplicate-poses", HostileData::kDuplicatePoses},
                          {"swapped-beads", HostileData::kSwappedBeads},
                          {"wrong-units", HostileData::kWrongUnits},
                          {"mirrored-phantom", HostileData::kMirroredPhantom},
                          {"other-machine", HostileData::kOtherMachine}},
                         "none");
  const auto count = [&](const char* name, std::optional<int>& value, const char* about, int standard) {
    command->add_option(name, value, about)->check(CLI::Range(1, 1000))->default_str(std::to_string(standard));
  };
  count("--camera-views", o->camera_views, "Views for the camera", usual.camera_views);
  count("--geometry-views", o->geometry_views, "Views for the geometry", usual.geometry_views);
  count("--poses", o->poses, "Registered poses of the anatomy", usual.hand_eye_poses);
  const auto amount = [&](const char* name, std::optional<double>& value, const char* about, double high,
                          double standard) {
    command->add_option(name, value, about)->check(between(0, high))->default_str(CLI::detail::to_string(standard));
  };
  amount("--noise-px", o->noise_px, "Of beads in tables, each axis", 10, usual.bead_noise_px);
  amount("--missing", o->missing, "Share of beads that no view shows", 0.8, usual.missing_beads);
  amount("--flex-mm", o->flex_mm, "How far the arm bends; its turns follow in proportion", 5, usual.flex_mm);
  command->add_option("--settings", o->settings, "Settings of the simulation (.yaml)");
  command->callback([o, &work] {
    work = [o] {
      if (o->experiment.empty() && o->out.empty()) throw InputError("--out", "", "", "or --study must be given");
      return o->experiment.empty() ? simulate(*o) : experiment(*o);
    };
  });
}

}  // namespace angio::apps

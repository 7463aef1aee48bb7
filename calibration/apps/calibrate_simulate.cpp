// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate simulate: a set of calibration data with known truth.
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <optional>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/calibration/calibration_simulation.hpp"
#include "angio/campaign/program.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "calibrate.hpp"
#include "simulated_study.hpp"

namespace angio::apps {
namespace {

// A change of the settings by an option.
using Override = std::function<void(CalibrationSimulationSettings&)>;

struct SimulateOptions : SimulatedStudy {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv");
  std::vector<Override> overrides;
  SimulatedImages images = SimulatedImages::kCamera;
};

CalibrationSimulationSettings effectiveSettings(const SimulateOptions& o) {
  CalibrationSimulationSettings s;
  if (!o.settings.empty()) s = readSettings(o.settings, s);
  if (o.study == "timing") s.camera_views = s.geometry_views = 120;
  for (const Override& change : o.overrides) change(s);
  return s;
}

int simulate(const SimulateOptions& o) {
  const CalibrationSimulationSettings settings = effectiveSettings(o);
  const VesselTree tree = readVesselTree(o.tree);
  CArmCalibration nominal = readCArmCalibration(o.nominal);
  nominal.model_id = modelId(tree);
  std::optional<ProgressBar> bar;
  writeCalibrationData(o.out, nominal, tree.centroid(), settings, o.images, [&](int done, int total) {
    if (!bar) bar.emplace("rendering", total);
    bar->show(done);
  });
  bar.reset();
  std::cout << settings.camera_views << " views for the camera, " << settings.geometry_views << " for the geometry and "
            << settings.hand_eye_poses << " poses of the anatomy are in " << o.out << "/, their truth in " << o.out
            << "/truth/carm.yaml\n";
  return 0;
}

// An option that sets one of the settings.
template <typename Value>
cli::Option* addSetting(cli::Command& command, SimulateOptions& o, const std::string& name,
                        Value CalibrationSimulationSettings::*field, const std::string& about) {
  const auto set = [&o, field](const Value& value) {
    o.overrides.push_back([field, value](CalibrationSimulationSettings& s) { s.*field = value; });
  };
  return command.addSetter<Value>(name, set, about, CalibrationSimulationSettings{}.*field);
}

}  // namespace

void addCalibrateSimulate(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<SimulateOptions>();
  using Settings = CalibrationSimulationSettings;
  auto* command = app.addSubcommand("simulate", "Write calibration data of a simulated C-arm, with their truth");
  command->footer(
      "Examples:\n  angio-calibrate simulate --out calibration --seed 3\n"
      "  angio-calibrate simulate --study camera --trials 200");
  command->addOption("--out", o->out, "Folder of the data; of a study, its results (.json)");
  command
      ->addOption("--study", o->study,
                  "No data: calibrate simulated machines and print errors against the truth: camera, geometry, timing")
      ->check(cli::oneOf({"camera", "geometry", "timing"}));
  command->addOption("--trials", o->trials, "Of a study")->check(cli::wholeBetween(1, 100000));
  addSetting(*command, *o, "--seed", &Settings::seed, "Seed of machine, patient and noise")
      ->check(cli::wholeBetween(0, 2147483647));
  command->addOption("--tree", o->tree, "Vessel tree of the patient");
  command->addOption("--nominal", o->nominal, "The C-arm and patient that are drawn around (.yaml)");
  const std::map<std::string, SimulatedImages> images{
      {"none", SimulatedImages::kNone}, {"camera", SimulatedImages::kCamera}, {"all", SimulatedImages::kAll}};
  command->addOption("--images", o->images, "Which views are X-ray images, not tables of beads: none, camera, all")
      ->check(choice(images))
      ->defaultText("camera");
  const std::map<std::string, SimulatedDistortion> distortions{{"none", SimulatedDistortion::kNone},
                                                               {"radial", SimulatedDistortion::kRadial},
                                                               {"intensifier", SimulatedDistortion::kIntensifier}};
  addSetting(*command, *o, "--distortion", &Settings::distortion, "Of the detector: none, radial, intensifier")
      ->check(choice(distortions))
      ->defaultText("none");
  const std::map<std::string, HostileData> hostile{{"none", HostileData::kNone},
                                                   {"duplicate-poses", HostileData::kDuplicatePoses},
                                                   {"swapped-beads", HostileData::kSwappedBeads},
                                                   {"wrong-units", HostileData::kWrongUnits},
                                                   {"mirrored-phantom", HostileData::kMirroredPhantom},
                                                   {"other-machine", HostileData::kOtherMachine}};
  addSetting(*command, *o, "--hostile", &Settings::hostile,
             "Data to be refused: duplicate-poses, swapped-beads, wrong-units, mirrored-phantom, other-machine")
      ->check(choice(hostile))
      ->defaultText("none");
  const auto count = [&](const char* name, int Settings::*field, const char* about) {
    addSetting(*command, *o, name, field, about)->check(cli::wholeBetween(1, 1000));
  };
  count("--camera-views", &Settings::camera_views, "Views for the camera");
  count("--geometry-views", &Settings::geometry_views, "Views for the geometry");
  count("--poses", &Settings::hand_eye_poses, "Registered poses of the anatomy");
  addSetting(*command, *o, "--noise-px", &Settings::bead_noise_px, "Of beads in tables, each axis")
      ->check(between(0, 10));
  addSetting(*command, *o, "--missing", &Settings::missing_beads, "Share of beads that no view shows")
      ->check(between(0, 0.8));
  const auto bend = [&overrides = o->overrides](double flex_mm) {
    overrides.push_back([flex_mm](Settings& s) {
      s.flex_deg *= flex_mm / s.flex_mm;
      s.flex_mm = flex_mm;
    });
  };
  command
      ->addSetter<double>("--flex-mm", bend, "How far the arm bends; its turns follow in proportion",
                          Settings().flex_mm)
      ->check(between(0, 5));
  addSettingsOptions(*command, o->settings, "Settings of the simulation (.yaml)", settingsInForce<Settings>);
  o->campaign.addTo(*command);
  command->onChosen([o, &work, &campaigns] {
    work = [o, &campaigns] {
      requireTrials(*o);
      return o->study.empty() ? simulate(*o) : runStudy(*o, effectiveSettings(*o), campaigns);
    };
  });
}

}  // namespace angio::apps

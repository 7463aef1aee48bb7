// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate simulate: a set of calibration data with known truth.
#include <algorithm>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/calibration/calibration_simulation.hpp"
#include "angio/calibration/geometry_calibration.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/results/experiment.hpp"
#include "calibrate.hpp"

namespace angio::apps {
namespace {

// A change of the settings by an option.
using Override = std::function<void(CalibrationSimulationSettings&)>;

struct SimulateOptions {
  std::string out, settings;
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), nominal = exampleDataFile("hepatic-tace/carm.yaml");
  std::vector<Override> overrides;
  SimulatedImages images = SimulatedImages::kCamera;
  std::string study;
  int trials = 200;
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

// Standard deviations of the camera that a geometry starts from: what angio-calibrate camera reaches with 20 views.
const Eigen::Vector4d kCameraSigma_px(1.2, 1.2, 1.0, 0.8);

// A machine, what it sees of a helix, and the noise of all that is measured of it.
struct Scene {
  CalibrationSimulationSettings settings;
  SimulatedDevice machine;
  Draws draws;
  BeadPhantom phantom = helixPhantom();

  Scene(const CArmCalibration& nominal, CalibrationSimulationSettings s, int trial)
      : settings(s), draws(static_cast<std::uint64_t>(s.seed + trial) * 104729 + 17) {
    settings.seed += trial;
    settings.held_out_every = 0;
    machine = simulatedMachine(nominal, Eigen::Vector3d::Zero(), settings);
  }

  const CArmGeometry& carm() const { return machine.truth.carm; }

  DetectorOfViews detector() const { return {carm().image_width_px, carm().image_height_px, carm().pixel_spacing_m}; }

  std::vector<BeadView> seen(const std::vector<SimulatedBeadView>& views) {
    std::vector<BeadView> all;
    for (const SimulatedBeadView& view : views) {
      BeadView& seen = all.emplace_back();
      seen.name = std::to_string(all.size());
      seen.joints = view.said;
      seen.source_detector_distance_m = view.source_detector_distance_m;
      for (std::size_t i = 0; i < view.shown.size(); ++i) {
        const Eigen::Vector2d pixel = view.pixels_px.col(i);
        seen.beads.push_back(
            {view.shown[i], pixel + settings.bead_noise_px * draws.vector(1).head<2>(), settings.bead_noise_px});
      }
    }
    return all;
  }

  GeometryCamera believedCamera() {
    GeometryCamera camera{carm().camera().parameters(), Eigen::Matrix4d(kCameraSigma_px.cwiseAbs2().asDiagonal())};
    camera.pixel_spacing_m = carm().pixel_spacing_m;
    camera.source_detector_distance_m = carm().source_detector_distance_m;
    int i = 0;
    for (double* value : {&camera.fx_px, &camera.fy_px, &camera.cx_px, &camera.cy_px}) {
      *value += kCameraSigma_px[i++] * draws.normal();
    }
    return camera;
  }
};

double squaredByCovariance(const CalibrationRecord& record, const std::vector<std::string>& names,
                           const std::vector<double>& truth) {
  std::vector<int> places;
  Eigen::VectorXd error(static_cast<Eigen::Index>(names.size()));
  for (std::size_t k = 0; k < names.size(); ++k) {
    const Eigen::Index at = record.placeOf(names[k]).value();
    places.push_back(static_cast<int>(at));
    error[k] = record.values[at] - truth[k];
  }
  const Eigen::MatrixXd covariance = record.covariance(places, places);
  return squaredMahalanobis(error, covariance);
}

// A row of a study's table and its value in one trial. With `freedom` it is a squared error by its covariance, whose
// mean that is.
struct Figure {
  std::string name;
  double value;
  double freedom = 0;
};

template <typename Trial>
std::string studied(int trials, const Trial& trial) {
  constexpr int kThreads = 1;
  ProgressBar bar("calibrating", trials);
  const auto records = recordsOf(
      trials, kThreads, [](int i) { return "trial " + std::to_string(i); }, trial, [&](int done) { bar.show(done); });
  std::string table = formatted("%-44s %8s %8s %8s\n", "", "median", "95 %", "worst");
  for (std::size_t k = 0; k < records.front().size(); ++k) {
    const auto& [name, first, freedom] = records.front()[k];
    std::vector<double> values;
    for (const std::vector<Figure>& record : records) values.push_back(record[k].value);
    table += formatted("%-44s ", name.c_str());
    if (freedom == 0) {
      table +=
          formatted("%8.4f %8.4f %8.4f\n", percentile(values, 0.5), percentile(values, 0.95), percentile(values, 1));
    } else {
      // Where the mean lies in 95 of 100 studies when the covariance is right.
      const double half = 1.96 * std::sqrt(2 * freedom / static_cast<double>(records.size()));
      table += formatted("%8.3f   (95 %% band %.3f to %.3f)\n", mean(values), freedom - half, freedom + half);
    }
  }
  return table;
}

std::vector<Figure> cameraTrial(Scene scene) {
  const auto views = simulatedCameraViews(scene.machine, scene.phantom, scene.settings);
  const CameraCalibration found = calibrateCamera(scene.phantom, scene.detector(), scene.seen(views));
  const auto p = scene.carm().camera().parameters();
  double squares = 0;
  for (std::size_t k = 0; k < views.size(); ++k) {
    squares +=
        (found.views[k].T_camera_phantom.inverse().translation() - views[k].T_camera_phantom.inverse().translation())
            .squaredNorm();
  }
  return {
      {"reprojection rms [px]", found.record.residual_rms},
      {"source position, seen from the phantom [mm]", 1e3 * std::sqrt(squares / static_cast<double>(views.size()))},
      {"NEES, principal point (2)", squaredByCovariance(found.record, {"cx_px", "cy_px"}, {p.cx_px, p.cy_px}), 2},
      {"NEES, fx, fy, cx, cy (4)",
       squaredByCovariance(found.record, {"fx_px", "fy_px", "cx_px", "cy_px"}, {p.fx_px, p.fy_px, p.cx_px, p.cy_px}),
       4}};
}

std::vector<Figure> geometryTrial(Scene scene, bool bends) {
  constexpr int kPositions = 50;  // At which no view was taken.
  const CArmGeometry& carm = scene.carm();
  const GeometryCamera camera = scene.believedCamera();
  const auto views = scene.seen(simulatedGeometryViews(scene.machine, scene.phantom, scene.settings));
  const GeometryCalibration found = calibrateGeometry("study", scene.phantom, camera, views);
  std::vector<std::string> names;
  std::vector<double> truth;
  const auto numbers = carm.poseParameters();
  for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
    const CArmParameter& parameter = kCArmPoseParameterNames[k];
    if (!found.record.placeOf(parameter.name)) continue;
    names.push_back(parameter.name);
    truth.push_back(numbers[k] / parameter.unit);
  }
  double direction = 0, target = 0;
  for (int k = 0; k < kPositions; ++k) {
    CArmJoints joints = CArmJoints::Zero();
    joints[0] = degToRad(scene.draws.uniform(-90, 90));
    joints[1] = degToRad(scene.draws.uniform(-40, 40));
    joints.tail<3>() = scene.draws.vector(0.02);
    const Pose T_true = carm.T_camera_patient(joints) * scene.machine.T_patient_phantom,
               T = found.carm.T_camera_patient(joints) * found.T_patient_phantom;
    direction += (T_true.linear().row(2) - T.linear().row(2)).squaredNorm();
    target += (T_true * scene.phantom.center_m() - T * scene.phantom.center_m()).squaredNorm();
  }
  std::vector<Figure> figures{{"beam's direction, other positions [deg]", radToDeg(std::sqrt(direction / kPositions))},
                              {"phantom's middle, other positions [mm]", 1e3 * std::sqrt(target / kPositions)},
                              {"residual rms, rigid arm [px]", found.rms_without_flex},
                              {"residual rms, arm that bends [px]", found.record.residual_rms}};
  if (bends) return figures;  // Bending that no model has is in the arm's numbers, too.
  figures.push_back({formatted("NEES, %zu numbers of the arm", names.size()),
                     squaredByCovariance(found.record, names, truth), static_cast<double>(names.size())});
  return figures;
}

// Wall time, the quickest of three [s].
template <typename Work>
double quickest_s(const Work& work) {
  double min_s = 1e9;
  for (int i = 0; i < 3; ++i) {
    const Stopwatch watch;
    work();
    min_s = std::min(min_s, watch.seconds());
  }
  return min_s;
}

void printTiming(const CArmCalibration& nominal, const CalibrationSimulationSettings& settings) {
  Scene scene(nominal, settings, 0);
  const auto camera_views = scene.seen(simulatedCameraViews(scene.machine, scene.phantom, scene.settings));
  const auto views = scene.seen(simulatedGeometryViews(scene.machine, scene.phantom, scene.settings));
  const GeometryCamera camera = scene.believedCamera();
  const double camera_s = quickest_s([&] { calibrateCamera(scene.phantom, scene.detector(), camera_views); });
  const double geometry_s = quickest_s([&] { calibrateGeometry("timing", scene.phantom, camera, views); });
  std::cout << formatted("camera, %d views: %.3f s\ngeometry, %d views: %.3f s (one thread, quickest of three)\n",
                         settings.camera_views, camera_s, settings.geometry_views, geometry_s);
}

void printStudy(const std::string& study, const CArmCalibration& nominal, const CalibrationSimulationSettings& settings,
                int trials) {
  std::cout << trials << " trials, " << settings.bead_noise_px << " px bead noise\n";
  if (study == "camera") {
    const std::string table = studied(trials, [&](int i) { return cameraTrial(Scene(nominal, settings, i)); });
    std::cout << "camera, " << settings.camera_views << " views\n" << table;
    return;
  }
  for (const bool bends : {false, true}) {
    CalibrationSimulationSettings s = settings;
    if (!bends) s.flex_mm = s.flex_deg = 0;
    const std::string table = studied(trials, [&](int i) { return geometryTrial(Scene(nominal, s, i), bends); });
    std::cout << "\ngeometry, " << s.geometry_views << " views, an arm that "
              << (bends ? "bends as no model does\n" : "is rigid\n") << table;
  }
}

// Calibrations of simulated machines against the truth.
int study(const SimulateOptions& o) {
  const CalibrationSimulationSettings settings = effectiveSettings(o);
  const CArmCalibration nominal = readCArmCalibration(o.nominal);
  if (o.study == "timing") {
    printTiming(nominal, settings);
  } else {
    printStudy(o.study, nominal, settings, o.trials);
  }
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

void addCalibrateSimulate(cli::Command& app, Work& work) {
  const auto o = std::make_shared<SimulateOptions>();
  using Settings = CalibrationSimulationSettings;
  auto* command = app.addSubcommand("simulate", "Write calibration data of a simulated C-arm, with their truth");
  command->footer(
      "Examples:\n  angio-calibrate simulate --out calibration --seed 3\n"
      "  angio-calibrate simulate --study camera --trials 200");
  auto* out = command->addOption("--out", o->out, "Folder");
  command
      ->addOption("--study", o->study,
                  "No files: calibrate simulated machines and print errors against the truth: camera, geometry, timing")
      ->check(cli::oneOf({"camera", "geometry", "timing"}))
      ->excludes(out);
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
  command->onChosen([o, &work] {
    work = [o] {
      if (o->study.empty() && o->out.empty()) throw InputError("--out", "", "", "or --study must be given");
      return o->study.empty() ? simulate(*o) : study(*o);
    };
  });
}

}  // namespace angio::apps

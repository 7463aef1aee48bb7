// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulated_study.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/calibration/geometry_calibration.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/campaign.hpp"

namespace angio::apps {
namespace {

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

template <typename Fields>
void visitRow(Fields& f, results::RecordOf<Fields, Figure>& figure) {
  f("name", figure.name);
  f("value", figure.value);
  f("freedom", figure.freedom);
}

// One table of a study: what each of its trials left.
struct StudyPart {
  std::string name;
  std::vector<std::vector<Figure>> trials;
};

// What is told of a figure over all trials.
Json summaryOf(const StudyPart& part, std::size_t figure) {
  const auto& [name, first, freedom] = part.trials.front()[figure];
  std::vector<double> values;
  for (const std::vector<Figure>& trial : part.trials) values.push_back(trial[figure].value);
  Json json{{"name", name}, {"values", values}};
  if (freedom == 0) {
    json.update(
        {{"median", percentile(values, 0.5)}, {"p95", percentile(values, 0.95)}, {"max", percentile(values, 1)}});
  } else {
    // Where the mean lies in 95 of 100 studies when the covariance is right.
    const double half = 1.96 * std::sqrt(2 * freedom / static_cast<double>(values.size()));
    json.update({{"mean", mean(values)}, {"band_min", freedom - half}, {"band_max", freedom + half}});
  }
  return json;
}

std::string studyTable(const Json& figures) {
  std::string table = formatted("%-44s %8s %8s %8s\n", "", "median", "95 %", "worst");
  for (const Json& figure : figures) {
    const auto number = [&](const char* key) { return figure.at(key).get<double>(); };
    table += formatted("%-44s ", figure.at("name").get<std::string>().c_str());
    if (figure.contains("median")) {
      table += formatted("%8.4f %8.4f %8.4f\n", number("median"), number("p95"), number("max"));
    } else {
      table += formatted("%8.3f   (95 %% band %.3f to %.3f)\n", number("mean"), number("band_min"), number("band_max"));
    }
  }
  return table;
}

template <typename Trial>
StudyPart studied(const std::string& name, int trials, const CampaignRun& run, const Trial& trial) {
  constexpr int kThreads = 1;
  ProgressBar bar("calibrating", run.share(trials));
  return {name, results::recordsOf(
                    run.rows, trials, kThreads, [](int i) { return "trial " + std::to_string(i); }, trial,
                    [&](int done) { bar.show(done); })};
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

std::vector<StudyPart> partsOf(const SimulatedStudy& o, const CArmCalibration& nominal,
                               const CalibrationSimulationSettings& settings, const CampaignRun& run) {
  if (o.study == "camera") {
    return {studied(formatted("camera, %d views", settings.camera_views), o.trials, run,
                    [&](int i) { return cameraTrial(Scene(nominal, settings, i)); })};
  }
  std::vector<StudyPart> parts;
  for (const bool bends : {false, true}) {
    CalibrationSimulationSettings s = settings;
    if (!bends) s.flex_mm = s.flex_deg = 0;
    const std::string name = formatted("geometry, %d views, an arm that ", s.geometry_views) +
                             (bends ? "bends as no model does" : "is rigid");
    parts.push_back(studied(name, o.trials, run, [&](int i) { return geometryTrial(Scene(nominal, s, i), bends); }));
  }
  return parts;
}

int study(const SimulatedStudy& o, const CArmCalibration& nominal, const CalibrationSimulationSettings& settings,
          const CampaignRun& run) {
  const std::vector<StudyPart> parts = partsOf(o, nominal, settings, run);
  if (!run.done()) return 0;
  Json json{{"study", o.study}, {"trials", o.trials}, {"bead_noise_px", settings.bead_noise_px}};
  std::cout << o.trials << " trials, " << settings.bead_noise_px << " px bead noise\n";
  for (const StudyPart& part : parts) {
    Json figures = Json::array();
    for (std::size_t k = 0; k < part.trials.front().size(); ++k) figures.push_back(summaryOf(part, k));
    std::cout << (parts.size() > 1 ? "\n" : "") << part.name << "\n" << studyTable(figures);
    json["tables"].push_back({{"name", part.name}, {"figures", std::move(figures)}});
  }
  if (o.out.empty()) return 0;
  if (!run.machine.is_null()) json["machine"] = run.machine;
  writeWholeFile(o.out, json.dump(2) + "\n");
  return 0;
}

}  // namespace

int runStudy(const SimulatedStudy& o, const CalibrationSimulationSettings& settings, const Campaigns& campaigns) {
  const CArmCalibration nominal = readCArmCalibration(o.nominal);
  if (o.study == "timing") {
    printTiming(nominal, settings);
    return 0;
  }
  CampaignJob job{
      o.campaign, o.out, o.trials, {}, [&](const CampaignRun& run) { return study(o, nominal, settings, run); }};
  for (const std::string& path : {o.settings, o.nominal}) addInput(job.inputs, path);
  return campaigns.run(job);
}

void requireTrials(const SimulatedStudy& o) {
  const bool in_trials = o.study == "camera" || o.study == "geometry";
  if (o.study.empty() && o.out.empty()) throw InputError("--out", "", "", "or --study must be given");
  if (o.study == "timing" && !o.out.empty()) throw InputError("", "--out", o.out, "must be of another study");
  if (in_trials) return;
  if (!o.campaign.shard.empty()) throw InputError("", "--shard", o.campaign.shard, "needs --study camera or geometry");
  if (o.campaign.estimate) throw InputError("", "--estimate", "", "needs --study camera or geometry");
}

}  // namespace angio::apps

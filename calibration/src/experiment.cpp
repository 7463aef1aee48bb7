// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/experiment.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "angio/base/stopwatch.hpp"
#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/geometry_calibration.hpp"
#include "calibration_simulation_draws.hpp"

namespace angio::calibration {
namespace {

// Standard deviations of the camera that a geometry starts from: what angio-calibrate camera reaches with 20 views.
const Eigen::Vector4d kCameraSigma_px(1.2, 1.2, 1.0, 0.8);

CalibrationSimulationSettings ofTrial(CalibrationSimulationSettings settings, int trial) {
  settings.seed += trial;
  return settings;
}

Draws noiseOf(const CalibrationSimulationSettings& settings) {
  return Draws(static_cast<std::uint64_t>(settings.seed) * 104729 + 17);
}

Eigen::Vector2d noisy(const Eigen::Vector2d& pixel, double noise_px, Draws& draws) {
  return pixel + noise_px * draws.vector(1).head<2>();
}

double squaredByCovariance(const CalibrationRecord& record, const std::vector<std::string>& names,
                           const std::vector<double>& truth) {
  std::vector<int> places;
  Eigen::VectorXd error(static_cast<Eigen::Index>(names.size()));
  for (std::size_t k = 0; k < names.size(); ++k) {
    const Eigen::Index at = record.placeOf(names[k]).value();
    places.push_back(static_cast<int>(at));
    error[static_cast<Eigen::Index>(k)] = record.values[at] - truth[k];
  }
  const Eigen::MatrixXd covariance = record.covariance(places, places);
  return error.dot(covariance.ldlt().solve(error));
}

std::vector<BeadView> beadViews(const std::vector<SimulatedBeadView>& views, double noise_px, Draws& draws) {
  std::vector<BeadView> seen;
  for (const SimulatedBeadView& view : views) {
    BeadView& bead_view = seen.emplace_back();
    bead_view.name = std::to_string(seen.size());
    bead_view.source_detector_distance_m = view.source_detector_distance_m;
    for (std::size_t i = 0; i < view.shown.size(); ++i) {
      const Eigen::Vector2d pixel = view.pixels_px.col(static_cast<Eigen::Index>(i));
      bead_view.beads.push_back({view.shown[i], noisy(pixel, noise_px, draws), noise_px});
    }
  }
  return seen;
}

std::vector<GeometryView> geometryViews(const std::vector<SimulatedBeadView>& views, double noise_px, Draws& draws) {
  std::vector<GeometryView> seen;
  for (const SimulatedBeadView& view : views) {
    GeometryView& geometry_view = seen.emplace_back();
    geometry_view.name = std::to_string(seen.size());
    geometry_view.joints = view.said;
    geometry_view.source_detector_distance_m = view.source_detector_distance_m;
    for (std::size_t i = 0; i < view.shown.size(); ++i) {
      const Eigen::Vector2d pixel = view.pixels_px.col(static_cast<Eigen::Index>(i));
      geometry_view.beads.push_back({view.shown[i], noisy(pixel, noise_px, draws)});
    }
  }
  return seen;
}

GeometryCamera believedCamera(const CArmGeometry& carm, Draws& draws) {
  const auto p = carm.camera().parameters();
  GeometryCamera camera;
  camera.width_px = p.width_px;
  camera.height_px = p.height_px;
  camera.pixel_spacing_m = carm.pixel_spacing_m;
  camera.source_detector_distance_m = carm.source_detector_distance_m;
  camera.covariance = Eigen::Matrix4d(kCameraSigma_px.cwiseAbs2().asDiagonal());
  int i = 0;
  for (const auto& [field, truth] : {std::pair{&camera.fx_px, p.fx_px}, std::pair{&camera.fy_px, p.fy_px},
                                     std::pair{&camera.cx_px, p.cx_px}, std::pair{&camera.cy_px, p.cy_px}}) {
    *field = truth + kCameraSigma_px[i++] * draws.normal();
  }
  return camera;
}

CalibrationSimulationSettings withoutHeldOut(CalibrationSimulationSettings settings) {
  settings.held_out_every = 0;
  return settings;
}

const Eigen::Vector3d kNoOffset = Eigen::Vector3d::Zero();

}  // namespace

std::vector<CameraTrial> cameraExperiment(const CArmCalibration& nominal, const CalibrationSimulationSettings& settings,
                                          int trials, const ExperimentProgress& tell) {
  const BeadPhantom phantom = helixPhantom();
  std::vector<CameraTrial> experiment;
  for (int i = 0; i < trials; ++i) {
    const CalibrationSimulationSettings s = withoutHeldOut(ofTrial(settings, i));
    const SimulatedDevice machine = simulatedMachine(nominal, kNoOffset, s);
    const std::vector<SimulatedBeadView> views = simulatedCameraViews(machine, phantom, s);
    Draws draws = noiseOf(s);
    const CArmGeometry& carm = machine.truth.carm;
    const CameraCalibration found =
        calibrateCamera(phantom, {carm.image_width_px, carm.image_height_px, carm.pixel_spacing_m},
                        beadViews(views, s.bead_noise_px, draws));
    const auto p = carm.camera().parameters();
    CameraTrial& trial = experiment.emplace_back();
    trial.rms_px = found.record.residual_rms;
    trial.principal_point_nees = squaredByCovariance(found.record, {"cx_px", "cy_px"}, {p.cx_px, p.cy_px});
    trial.camera_nees =
        squaredByCovariance(found.record, {"fx_px", "fy_px", "cx_px", "cy_px"}, {p.fx_px, p.fy_px, p.cx_px, p.cy_px});
    double sum = 0;
    for (std::size_t k = 0; k < views.size(); ++k) {
      sum +=
          (found.views[k].T_camera_phantom.inverse().translation() - views[k].T_camera_phantom.inverse().translation())
              .squaredNorm();
    }
    trial.source_m = std::sqrt(sum / static_cast<double>(views.size()));
    if (tell) tell(i + 1);
  }
  return experiment;
}

std::vector<GeometryTrial> geometryExperiment(const CArmCalibration& nominal,
                                              const CalibrationSimulationSettings& settings, int trials,
                                              const ExperimentProgress& tell) {
  constexpr int kPositions = 50;
  const BeadPhantom phantom = helixPhantom();
  std::vector<GeometryTrial> experiment;
  for (int i = 0; i < trials; ++i) {
    const CalibrationSimulationSettings s = withoutHeldOut(ofTrial(settings, i));
    const SimulatedDevice machine = simulatedMachine(nominal, kNoOffset, s);
    Draws draws = noiseOf(s);
    const CArmGeometry& carm = machine.truth.carm;
    const GeometryCamera camera = believedCamera(carm, draws);
    const GeometryCalibration found = calibrateGeometry(
        "study", phantom, camera, geometryViews(simulatedGeometryViews(machine, phantom, s), s.bead_noise_px, draws));
    GeometryTrial& trial = experiment.emplace_back();
    trial.rms_px = found.record.residual_rms;
    trial.rms_rigid_px = found.rms_without_flex;
    std::vector<std::string> names;
    std::vector<double> truth;
    const auto numbers = carm.poseParameters();
    for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
      const CArmParameter& parameter = kCArmPoseParameterNames[k];
      const auto& known = found.record.parameters;
      if (std::find(known.begin(), known.end(), parameter.name) == known.end()) continue;
      names.push_back(parameter.name);
      truth.push_back(numbers[static_cast<Eigen::Index>(k)] / parameter.unit);
    }
    trial.numbers = static_cast<int>(names.size());
    trial.nees = squaredByCovariance(found.record, names, truth) / trial.numbers;
    double direction = 0, target = 0;
    for (int k = 0; k < kPositions; ++k) {
      CArmJoints joints = CArmJoints::Zero();
      joints[0] = degToRad(draws.uniform(-90, 90));
      joints[1] = degToRad(draws.uniform(-40, 40));
      joints.tail<3>() = draws.vector(0.02);
      const Pose T_true = carm.T_camera_patient(joints) * machine.T_patient_phantom,
                 T = found.carm.T_camera_patient(joints) * found.T_patient_phantom;
      direction += (T_true.linear().row(2) - T.linear().row(2)).squaredNorm();
      target += (T_true * phantom.center_m() - T * phantom.center_m()).squaredNorm();
    }
    trial.direction_rad = std::sqrt(direction / kPositions);
    trial.target_m = std::sqrt(target / kPositions);
    if (tell) tell(i + 1);
  }
  return experiment;
}

CalibrationTimes calibrationTimes(const CArmCalibration& nominal, const CalibrationSimulationSettings& settings) {
  const BeadPhantom phantom = helixPhantom();
  const CalibrationSimulationSettings s = withoutHeldOut(settings);
  const SimulatedDevice machine = simulatedMachine(nominal, kNoOffset, s);
  const CArmGeometry& carm = machine.truth.carm;
  Draws draws = noiseOf(s);
  const auto camera_views = beadViews(simulatedCameraViews(machine, phantom, s), s.bead_noise_px, draws);
  const auto views = geometryViews(simulatedGeometryViews(machine, phantom, s), s.bead_noise_px, draws);
  const GeometryCamera camera = believedCamera(carm, draws);
  const DetectorOfViews detector{carm.image_width_px, carm.image_height_px, carm.pixel_spacing_m};
  const auto quickest = [](const std::function<void()>& work) {
    double min_s = 1e9;
    for (int i = 0; i < 3; ++i) {
      const Stopwatch watch;
      work();
      min_s = std::min(min_s, watch.seconds());
    }
    return min_s;
  };
  return {quickest([&] { calibrateCamera(phantom, detector, camera_views); }),
          quickest([&] { calibrateGeometry("timing", phantom, camera, views); })};
}

}  // namespace angio::calibration

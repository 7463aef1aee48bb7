// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/calibration_simulation.hpp"

#include <algorithm>

namespace angio::calibration {
namespace {

// Each use has its own stream, so that another number of views leaves the machine as it is.
enum class Stream : std::uint64_t { kMachine = 1, kOtherMachine, kCameraViews, kGeometryViews };

Draws drawsFor(const CalibrationSimulationSettings& settings, Stream stream) {
  return Draws(static_cast<std::uint64_t>(settings.seed) * 1000003 + static_cast<std::uint64_t>(stream));
}

constexpr double kRightAngle = kPi / 2;

void drawDeviations(CArmGeometry& carm, const CalibrationSimulationSettings& s, Draws& draws) {
  auto values = carm.poseParameters();
  for (std::size_t k = 0; k < kCArmPoseParameters; ++k) {
    const double unit = kCArmPoseParameterNames[k].unit;
    const double std = unit == 1 ? s.table_scale : unit == 1e-3 ? 1e-3 * s.offset_mm : degToRad(s.offset_deg);
    values[k] += std * draws.normal();
  }
  carm.setPoseParameters(values);
  CArmDeviations& d = carm.deviations;
  d.source_detector_offset_m = 1e-3 * s.offset_mm * draws.normal();
  d.principal_point_px = s.principal_point_px * draws.vector(1).head<2>();
  d.principal_point_slope_px_per_m = 5 * s.principal_point_px * draws.vector(1).head<2>();
  // Waves between those of CArmFlex::lowOrder(), so that no estimate can be exact.
  if (s.flex_mm == 0 && s.flex_deg == 0) return;
  d.flex.count = 6;
  for (int i = 0; i < d.flex.count; ++i) {
    CArmFlexTerm& term = d.flex.terms[i];
    term.twist = draws.twist(1e-3 * s.flex_mm, degToRad(s.flex_deg));
    term.frequency_primary = draws.uniform(0.2, 1.9);
    term.frequency_secondary = draws.uniform(-1.9, 1.9);
    term.phase_rad = draws.uniform(-kPi, kPi);
  }
}

std::optional<DetectorDistortion> drawnDistortion(const CArmGeometry& carm, SimulatedDistortion kind, Draws& draws) {
  const XrayCamera camera = carm.camera();
  switch (kind) {
    case SimulatedDistortion::kNone:
      break;
    case SimulatedDistortion::kRadial:
      return DetectorDistortion::radial(camera, draws.uniform(0.2, 0.5), 0);
    case SimulatedDistortion::kIntensifier:
      return DetectorDistortion::intensifier(camera, {draws.uniform(0.02, 0.05), 0, degToRad(draws.uniform(1, 3)), 0});
  }
  return std::nullopt;
}

// A bead that the detector's edge cuts is not measured.
const Eigen::Vector2d kBorder(10, 10);

SimulatedBeadView viewAt(const SimulatedDevice& machine, const BeadPhantom& phantom,
                         const CalibrationSimulationSettings& s, const CArmJoints& joints, double distance_m,
                         Draws& draws) {
  SimulatedBeadView view;
  view.joints = view.said = joints;
  for (int k = 0; k < kCArmJointCount; ++k) {
    view.said[k] += (k < 2 ? degToRad(s.encoder_noise_deg) : 1e-3 * s.encoder_noise_mm) * draws.normal();
  }
  view.source_detector_distance_m = distance_m;
  const CArmGeometry& carm = machine.truth.carm;
  view.T_camera_phantom = carm.T_camera_patient(joints) * machine.T_patient_phantom;
  const XrayCamera camera = carm.camera(distance_m);
  std::vector<Eigen::Vector2d> pixels;
  for (std::size_t i = 0; i < phantom.beads.size(); ++i) {
    const bool missing = draws.uniform(0, 1) < s.missing_beads;
    const auto pixel = camera.project(view.T_camera_phantom * phantom.beads[i].position_m);
    if (missing || !pixel) continue;
    const Eigen::Vector2d shown = machine.distortion ? machine.distortion->distorted(*pixel) : *pixel;
    if (!camera.sees(shown - kBorder) || !camera.sees(shown + kBorder)) continue;
    view.shown.push_back(static_cast<int>(i));
    pixels.push_back(*pixel);
  }
  view.pixels_px.resize(2, pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) view.pixels_px.col(i) = pixels[i];
  return view;
}

// Radical inverse: places that fill a range evenly, however many there are.
double evenly(int index, int base) {
  double place = 0, step = 1.0 / base;
  for (int i = index + 1; i > 0; i /= base, step /= base) place += step * (i % base);
  return place;
}

struct Placed {
  CArmJoints joints;
  double distance_m;
};

// Views at the places that `place` gives by their numbers.
template <typename Place>
std::vector<SimulatedBeadView> viewsAt(const SimulatedDevice& machine, const BeadPhantom& phantom,
                                       const CalibrationSimulationSettings& s, Stream stream, int count,
                                       const Place& place) {
  Draws draws = drawsFor(s, stream);
  std::vector<SimulatedBeadView> views;
  for (int i = 0; i < count; ++i) {
    const Placed at = place(i);
    views.push_back(viewAt(machine, phantom, s, at.joints, at.distance_m, draws));
    views.back().held_out = s.held_out_every > 0 && (i + 1) % s.held_out_every == 0;
  }
  return views;
}

constexpr double kMaxDistance_m = 0.1;  // Beyond the usual source-detector distance.

}  // namespace

SimulatedDevice simulatedMachine(const CArmCalibration& nominal, const Eigen::Vector3d& center_model,
                                 const CalibrationSimulationSettings& s) {
  checkSettings("simulation", s);
  Draws draws = drawsFor(s, Stream::kMachine);
  SimulatedDevice machine;
  machine.truth = miscalibrated(nominal, center_model, draws.vector(1), degToRad(s.patient_turn_deg),
                                1e-3 * s.patient_shift_mm * draws.vector(1).normalized());
  machine.truth.machine = "simulated-" + std::to_string(s.seed);
  machine.truth.records.clear();
  drawDeviations(machine.truth.carm, s, draws);
  machine.distortion = drawnDistortion(machine.truth.carm, s.distortion, draws);
  // The helix lies along the table, on a wedge.
  machine.T_patient_phantom.linear() = expSO3(draws.vector(0.1));
  machine.T_patient_phantom.translation() = draws.vector(8e-3);
  return machine;
}

SimulatedDevice otherMachine(const SimulatedDevice& machine, const CalibrationSimulationSettings& s) {
  Draws draws = drawsFor(s, Stream::kOtherMachine);
  SimulatedDevice other = machine;
  CalibrationSimulationSettings worse = s;
  worse.offset_deg = std::max(s.offset_deg, 0.4);
  worse.offset_mm = std::max(s.offset_mm, 3.0);
  other.truth.carm.deviations = {};
  drawDeviations(other.truth.carm, worse, draws);
  // Another make: another isocentre, another detector.
  other.truth.carm.source_isocenter_distance_m -= 0.03;
  other.truth.carm.deviations.source_detector_offset_m += 0.03;
  return other;
}

std::vector<SimulatedBeadView> simulatedCameraViews(const SimulatedDevice& machine, const BeadPhantom& phantom,
                                                    const CalibrationSimulationSettings& s) {
  return viewsAt(machine, phantom, s, Stream::kCameraViews, s.camera_views, [&](int i) {
    CArmJoints joints;
    // Tilted and shifted so far that most beads stay on the detector: those at its edge tell most.
    joints << kRightAngle * (2 * evenly(i, 2) - 1), degToRad(60) * (evenly(i, 3) - 0.5), 0.02 * (evenly(i, 5) - 0.5),
        0.02 * (evenly(i, 7) - 0.5), 0.02 * (evenly(i, 11) - 0.5);
    return Placed{joints, machine.truth.carm.source_detector_distance_m};
  });
}

std::vector<SimulatedBeadView> simulatedGeometryViews(const SimulatedDevice& machine, const BeadPhantom& phantom,
                                                      const CalibrationSimulationSettings& s) {
  const double usual_m = machine.truth.carm.source_detector_distance_m;
  return viewsAt(machine, phantom, s, Stream::kGeometryViews, s.geometry_views, [&](int i) {
    CArmJoints joints = CArmJoints::Zero();
    joints[0] = degToRad(100) * (2 * evenly(i, 2) - 1);
    joints[1] = degToRad(45) * (2 * evenly(i, 3) - 1);
    if (i % 3 == 0)
      joints.tail<3>() << 0.1 * (evenly(i, 5) - 0.5), 0.1 * (evenly(i, 7) - 0.5), 0.1 * (evenly(i, 11) - 0.5);
    const double distance_m = i % 4 == 1 ? usual_m + kMaxDistance_m * (i % 8 == 1 ? 1 : -0.5) : usual_m;
    return Placed{joints, distance_m};
  });
}

}  // namespace angio::calibration

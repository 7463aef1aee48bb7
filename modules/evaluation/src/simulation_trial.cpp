// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/evaluation/simulation.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/registration/starts.hpp"
#include "angio/simulation/contrast_filling.hpp"
#include "angio/simulation/patient_motion.hpp"
#include "angio/simulation/tree_deformation.hpp"
#include "angio/vessel/resample.hpp"
#include "simulation_image.hpp"

namespace angio::evaluation {
namespace {

constexpr int kMaxFinePoints = 200000;
// Numbers of drawnPose's draws that no method's own starts have: a method must not draw the trial's offset again.
constexpr int kFirstStartIndex = 1000000;

Pose drawnView(const VesselTree& tree, const SimulationSettings& s, int index) {
  SimulationRandom random(s.seed, index, DrawFor::kView);
  ViewAngles angles;
  angles.primary_rad = degToRad(s.primary_deg + s.primary_range_deg * random.uniform(-1, 1));
  angles.secondary_rad = degToRad(s.secondary_deg + s.secondary_range_deg * random.uniform(-1, 1));
  const double roll_rad = degToRad(s.roll_range_deg) * random.uniform(-1, 1);
  Pose T = Pose::Identity();
  T.linear() = expSO3({0, 0, roll_rad}) * viewRotation(angles) * lpsOf(s.model_axes);
  T.translation() = Eigen::Vector3d(0, 0, 1e-3 * s.source_isocenter_mm) - T.linear() * tree.centroid();
  return T;
}

// A turn about a point of the camera's axis, and a shift.
Pose turnedAbout(double depth_m, const Eigen::Vector3d& rotation_rad,
                 const Eigen::Vector3d& shift_m = Eigen::Vector3d::Zero()) {
  const Eigen::Translation3d to_center(0, 0, depth_m);
  Pose turn = Pose::Identity();
  turn.linear() = expSO3(rotation_rad);
  return to_center * Eigen::Translation3d(shift_m) * turn * to_center.inverse();
}

// Another plane, about an axis across the beam: the second of a biplane system, or one on the way of a turn.
Pose otherPlane(const SimulationSettings& s, int index, int view) {
  SimulationRandom random(s.seed, index, DrawFor::kView, 1);
  double angle_rad = degToRad(random.uniform(70, 110));
  if (s.turn_deg > 0) angle_rad = degToRad(s.turn_deg) * view / (s.views - 1);
  const Eigen::Vector2d axis = random.direction<2>();
  return turnedAbout(1e-3 * s.source_isocenter_mm, angle_rad * Eigen::Vector3d(axis.x(), axis.y(), 0));
}

// Where and when the frames of a sequence are taken.
struct SequenceFrame {
  double time_s;
  Pose T_frame_last;
};

constexpr double kStanding_s = 4, kStandingPeriod_s = 0.25, kTurningPeriod_s = 1.0 / 15;

std::vector<SequenceFrame> sequenceOf(const SimulationSettings& s, const Pose& T_camera_model) {
  // The patient's long axis, which the primary angle turns about.
  const Eigen::Vector3d axis = T_camera_model.linear() * lpsOf(s.model_axes).transpose().col(2);
  std::vector<SequenceFrame> frames;
  const auto add = [&](double time_s, double left_deg) {
    frames.push_back({time_s, turnedAbout(1e-3 * s.source_isocenter_mm, -degToRad(left_deg) * axis)});
  };
  for (double time_s = 0; time_s < kStanding_s - 1e-9; time_s += kStandingPeriod_s) add(time_s, s.turn_deg);
  const int turning = std::max(1, static_cast<int>(std::lround(s.turn_s / kTurningPeriod_s)));
  for (int k = 0; k <= turning; ++k) {
    const double share = static_cast<double>(k) / turning;
    add(kStanding_s + s.turn_s * share, s.turn_deg * (1 - share));
  }
  return frames;
}

// As the frames of one trial see the patient breathe: each trial begins in another breath.
PatientMotion breathOf(const VesselTree& tree, const SimulationSettings& s) {
  MotionSettings motion;
  motion.breathing.amplitude_mm = s.breath_mm;
  return PatientMotion(motion, tree.centroid(), lpsOf(s.model_axes), static_cast<std::uint64_t>(s.seed));
}

// Four plane waves, of wavelengths of 1 to 3 times the tree's extent.
DisplacementField waves(const VesselTree& tree, const SimulationSettings& s, SimulationRandom random) {
  struct Wave {
    Eigen::Vector3d wave_vector, amplitude;
    double phase = 0;
  };
  const Eigen::Matrix3d R = lpsOf(s.model_axes);
  const Eigen::Vector3d by_axis(1, 1, s.deformation_anisotropy);
  const double extent_m = (tree.points().rowwise().maxCoeff() - tree.points().rowwise().minCoeff()).maxCoeff();
  std::vector<Wave> all;
  for (int k = 0; k < 4; ++k) {
    Wave wave;
    const double wavelength_m = extent_m * random.uniform(1, 3);
    wave.wave_vector = 2 * kPi / wavelength_m * random.direction<3>();
    wave.amplitude = R.transpose() * by_axis.asDiagonal() * R * random.normals<3>();
    wave.phase = random.uniform(0, 2 * kPi);
    all.push_back(wave);
  }
  return [all](const Eigen::Vector3d& p) {
    Eigen::Vector3d d = Eigen::Vector3d::Zero();
    for (const Wave& wave : all) d += wave.amplitude * std::sin(wave.wave_vector.dot(p) + wave.phase);
    return d;
  };
}

// A measured motion, or waves, drawn for the trial.
TreeDeformation drawnDeformation(const VesselTree& tree, const SimulationSettings& s, int trial,
                                 const MeasuredMotion* measured) {
  SimulationRandom random(s.seed, trial, DrawFor::kDeformation);
  if (!measured) return {tree, waves(tree, s, random), 1e-3 * s.deformation_rms_mm};
  const double u = random.uniform(), v = random.uniform(), w = random.uniform();
  return {tree, carriedOver(*measured, tree, uniformRotation(u, v, w)), 1e-3 * s.deformation_rms_mm};
}

// Of each branch what one view's detector sees, in 3D [m].
std::vector<double> lengthsInView(const VesselTree& tree, const Eigen::Matrix3Xd& points_camera,
                                  const XrayCamera& camera) {
  std::vector<double> lengths_m;
  for (const auto& branch : tree.branches()) {
    double length_m = 0;
    for (std::size_t k = 1; k < branch.size(); ++k) {
      const Eigen::Vector3d a = points_camera.col(branch[k - 1]), b = points_camera.col(branch[k]);
      const auto pixel = camera.project(0.5 * (a + b));
      if (pixel && camera.sees(*pixel)) length_m += (b - a).norm();
    }
    lengths_m.push_back(length_m);
  }
  return lengths_m;
}

std::vector<Curve> projectedBranches(const VesselTree& tree, const Eigen::Matrix3Xd& points_camera,
                                     const XrayCamera& camera) {
  std::vector<Curve> curves;
  for (const auto& branch : tree.branches()) {
    Curve curve;
    for (const int i : branch) {
      if (const auto pixel = camera.project(points_camera.col(i))) curve.push_back(*pixel);
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

// What a method is told of a camera.
XrayCamera miscalibrated(const XrayCamera& camera, const SimulationSettings& s, int index, int view) {
  SimulationRandom random(s.seed, index, DrawFor::kCalibration, view);
  const double sign = random.uniform() < 0.5 ? -1 : 1;
  const Eigen::Vector2d shift_px = s.principal_point_error_px * random.direction<2>();
  const double factor = 1 + sign * s.focal_error_percent / 100;
  XrayCamera::Parameters p = camera.parameters();
  p.fx_px *= factor;
  p.fy_px *= factor;
  p.cx_px += shift_px.x();
  p.cy_px += shift_px.y();
  if (p.source_detector_distance_m) *p.source_detector_distance_m *= factor;
  return XrayCamera(p);
}

Pose miscalibratedPlane(const Pose& T_view_first, const SimulationSettings& s, int index) {
  SimulationRandom random(s.seed, index, DrawFor::kCalibration, -1);
  const Eigen::Vector3d turn_rad = degToRad(s.calibration_rotation_error_deg) * random.direction<3>();
  const Eigen::Vector3d shift_m = 1e-3 * s.calibration_translation_error_mm * random.direction<3>();
  return turnedAbout(1e-3 * s.source_isocenter_mm, turn_rad, shift_m) * T_view_first;
}

Pose drawnTrialStart(const VesselTree& tree, const Pose& truth, const SimulationSettings& s, int index) {
  const auto scaled = [&](double factor) {
    return drawnPose(truth, tree.centroid(), factor * degToRad(s.rotation_std_deg),
                     factor * 1e-3 * s.translation_std_mm, s.seed, kFirstStartIndex + index);
  };
  if (!(s.even_starts_mm > 0)) return scaled(1);
  SimulationRandom random(s.seed, index, DrawFor::kStart);
  const double wanted_m = 1e-3 * s.even_starts_mm * random.uniform();
  double factor = 1;
  for (int i = 0; i < 8; ++i) {  // The distance is nearly linear in the factor.
    const double mtre_m = ((scaled(factor) * tree.points()) - (truth * tree.points())).colwise().norm().mean();
    if (!(mtre_m > 0)) break;
    factor *= wanted_m / mtre_m;
  }
  return scaled(factor);
}

}  // namespace

XrayViews SimulatedTrial::views() const {
  XrayViews result;
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    result.push_back(XrayView{centerlines[v], cameras[v], T_view_first[v], {}});
  }
  return result;
}

Eigen::Matrix3d lpsOf(ModelAxes axes) {
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();
  if (axes == ModelAxes::kRas) R_lps_model.diagonal() << -1, -1, 1;
  if (axes == ModelAxes::kLip) R_lps_model << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return R_lps_model;
}

XrayCamera simulatedCamera() { return XrayCamera::centered(1024, 1024, 0.308e-3, 1.195); }

SimulatedTrial simulatedTrial(const VesselTree& tree, const std::optional<XrayCamera>& camera,
                              const SimulationSettings& settings, int index, const MeasuredMotion* motion) {
  checkSettings("simulation", settings);
  const bool turns = settings.turn_deg > 0, sequence = settings.turn_s > 0;
  const auto refuse = [](bool wrong, const char* key, double value, const char* rule) {
    if (wrong) throw InputError("simulation", key, formatValue(value), rule);
  };
  refuse(sequence && (settings.views > 1 || !turns), "turn_s", settings.turn_s,
         "needs turn_deg, and no views beside it");
  refuse(sequence && settings.from == TrialSource::kImages, "turn_s", settings.turn_s,
         "must be 0: images are of one moment");
  refuse(settings.breath_mm > 0 && !sequence, "breath_mm", settings.breath_mm, "needs turn_s: views of one moment");
  refuse(settings.views > 2 && !turns, "views", settings.views, "must be 1 or 2 without turn_deg");
  refuse(settings.views < 2 && turns && !sequence, "views", settings.views, "must be at least 2 with turn_deg");
  SimulatedTrial trial;
  trial.truth = drawnView(tree, settings, index);
  trial.start = drawnTrialStart(tree, trial.truth, settings, index);
  const XrayCamera detector = camera.value_or(simulatedCamera());
  const VesselTree fine = resampled(tree, 1e-3 * settings.tree_spacing_mm, kMaxFinePoints).tree;
  Eigen::Matrix3Xd points = fine.points();
  if (settings.deformation_rms_mm > 0) {
    const TreeDeformation field = drawnDeformation(tree, settings, index, motion);
    trial.displacements_m = field.at(tree.points());
    points += field.at(fine.points());
  }
  // Splitting edges leaves the branches as they are: those of the fine tree are those of the tree.
  const FillingDraws draws{
      SimulationRandom(settings.seed, index, DrawFor::kMissing).order(static_cast<int>(fine.branches().size())),
      SimulationRandom(settings.seed, index, DrawFor::kFilled).uniform()};
  const auto filled = filledBranches(fine, lengthsInView(fine, trial.truth * points, detector),
                                     {settings.filled, settings.missing}, draws);
  trial.filled = filledPoints(tree, filled);
  const auto addView = [&](const Pose& T_view_first, const Eigen::Matrix3Xd& there, int v, bool first) {
    const auto branches = projectedBranches(fine, T_view_first * trial.truth * there, detector);
    SimulatedView view = simulatedView(branches, filled, detector, settings, index, v);
    trial.true_views.push_back({view.camera, T_view_first, std::move(view.spurious_px)});
    trial.cameras.push_back(miscalibrated(view.camera, settings, index, v));
    trial.centerlines.push_back(std::move(view.centerline));
    trial.T_view_first.push_back(first ? T_view_first : miscalibratedPlane(T_view_first, settings, index));
  };
  if (sequence) {
    const PatientMotion breath = breathOf(tree, settings);
    const double begin_s = SimulationRandom(settings.seed, index, DrawFor::kStart, 1).uniform(0, 1000);
    const auto frames = sequenceOf(settings, trial.truth);
    for (std::size_t f = 0; f < frames.size(); ++f) {
      const double time_s = begin_s + frames[f].time_s;
      addView(frames[f].T_frame_last, points + breath.displacements(fine.points(), time_s), static_cast<int>(f),
              f + 1 == frames.size());
      trial.times_s.push_back(frames[f].time_s);
    }
    if (trial.displacements_m.size() == 0) trial.displacements_m.setZero(3, tree.size());
    trial.displacements_m += breath.displacements(tree.points(), begin_s + frames.back().time_s);
    return trial;
  }
  for (int v = 0; v < settings.views; ++v) {
    addView(v == 0 ? Pose::Identity() : otherPlane(settings, index, v), points, v, v == 0);
  }
  return trial;
}

}  // namespace angio::evaluation

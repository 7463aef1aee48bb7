// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/closed_loop.hpp"

#include <cmath>
#include <random>

#include "angio/base/errors.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/experiments/observers.hpp"
#include "angio/servo/operator.hpp"
#include "angio/types/channels.hpp"

namespace angio::experiments {
namespace {

// Uniform on the sphere, the same on every machine.
Eigen::Vector3d randomDirection(std::mt19937_64& engine) {
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const double z = 2 * uniform() - 1, angle = 2 * kPi * uniform(), r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

ViewAngles startAngles(const ScenarioSettings& s) {
  return {degToRad(s.start_primary_deg), degToRad(s.start_secondary_deg)};
}

// Where the image of a target is wanted [rays with z = 1]: at the principal point, beside it, or where it was at first.
std::optional<Eigen::Vector2d> wantedRay(const ServoLoopSettings& loop) {
  if (std::holds_alternative<HoldTaskSettings>(loop.task)) return std::nullopt;
  if (std::holds_alternative<ResolveDepthTaskSettings>(loop.task)) return std::nullopt;
  const auto* center = std::get_if<CenterTaskSettings>(&loop.task);
  if (!center) return Eigen::Vector2d::Zero();
  const auto camera = loop.carm.camera().parameters();
  return Eigen::Vector2d(center->offset_px[0] / camera.fx_px, center->offset_px[1] / camera.fy_px);
}

// How far the real view is from the wanted one, for a task that has one, and the target's image from its place.
class Observer {
 public:
  Observer(const Scenario& world, const Task& task, const ServoLoopSettings& loop, const VesselTree& tree,
           const SimulatedPatientSettings& patient)
      : truth_(world.truth),
        deformed_(patient.motion.deformation.rms_mm > 0 ? std::optional(tree.points()) : std::nullopt),
        desired_(task.desired_T_camera_model()),
        target_(targetOf(loop, tree)),
        wanted_(wantedRay(loop)) {}

  bool hasView() const { return desired_.has_value(); }

  void observe(const SimulatedLab& lab, ClosedLoopFrame& row) {
    row.time_s = lab.now_s();
    row.true_error = error(row.joints, lab);
    row.target_camera = lab.inCamera(target_);
    const Eigen::Vector2d ray = row.target_camera.hnormalized();
    if (!wanted_) wanted_ = ray;
    row.target_off_m = truth_.carm.source_isocenter_distance_m * (ray - *wanted_).norm();
  }

  // Of the true motion from these joints to the desired view; nothing for a task without one or when no joints see it.
  std::optional<TrajectoryObserver> trajectory(const CArmJoints& start, const CArmLimits& limits) const {
    if (!desired_) return std::nullopt;
    const Eigen::Vector3d on_beam =
        desired_->inverse() * Eigen::Vector3d(0, 0, truth_.carm.source_isocenter_distance_m);
    const Eigen::Vector3d beam = truth_.T_dsa_cb.linear() * desired_->linear().row(2).transpose();
    const auto goal = truth_.carm.reachable(viewAnglesOf(beam), truth_.T_dsa_cb * on_beam, limits, start);
    if (!goal) return std::nullopt;
    return TrajectoryObserver(truth_.carm, start, *goal, truth_.T_dsa_cb * on_beam);
  }

  // With these joints, of the patient as it lies now.
  ViewError error(const CArmJoints& joints, const SimulatedLab& lab) const {
    if (!desired_) return {};
    return viewError(truth_.carm.T_camera_patient(joints) * T_patient_model(lab), *desired_, target_);
  }

 private:
  // Of a deformed tree: turned as the rigid one is that is nearest to it, with the target where that is.
  Pose T_patient_model(const SimulatedLab& lab) const {
    if (!deformed_) return truth_.T_dsa_cb;
    const Pose T_patient_camera = truth_.carm.T_camera_patient(lab.arm().state().joints).inverse();
    Eigen::Matrix3Xd moved(3, deformed_->cols());
    for (Eigen::Index i = 0; i < moved.cols(); ++i) moved.col(i) = T_patient_camera * lab.inCamera(deformed_->col(i));
    Pose T(Eigen::umeyama(*deformed_, moved, false));
    return T.pretranslate(T_patient_camera * lab.inCamera(target_) - T * target_);
  }

  CArmCalibration truth_;
  std::optional<Eigen::Matrix3Xd> deformed_;  // Points of a deformed tree.
  std::optional<Pose> desired_;
  Eigen::Vector3d target_;
  std::optional<Eigen::Vector2d> wanted_;
};

ClosedLoopFrame describe(const ServoReport& report) {
  ClosedLoopFrame row;
  row.command = report.command;
  row.task = report.task;
  row.hold_reason = report.hold_reason;
  const Observation& observation = report.observation;
  row.status = observation.registration.status;
  row.model_residual_px = observation.registration.alignment.model_residual_px;
  row.image_residual_px = observation.registration.alignment.image_residual_px;
  row.points_2d = observation.centerline.size();
  row.image_s = observation.image_s;
  row.registration_s = observation.registration_s;
  row.control_s = report.control_s;
  return row;
}

void runClosed(const VesselTree& tree, const Scenario& world, const ScenarioSettings& s, const ServoLoopSettings& loop,
               const SimulatedPatientSettings& patient, const ClosedLoopObserver& watcher,
               const ArmWatcher& arm_watcher, ClosedLoopRun& result) {
  SimulatedLab lab = labOf(tree, world, s, loop, patient);
  ServoNode servo(lab.loopSide(), loop, tree);
  Operator person(lab.fromMachines());
  Observer observer(world, servo.loop().task(), loop, tree, patient);
  result.has_view = observer.hasView();
  auto trajectory = observer.trajectory(lab.arm().state().joints, loop.limits);
  const auto watchTrajectory = [&] {
    if (trajectory) trajectory->see(lab.arm().state().joints);
  };
  const int frames = framesOf(s);
  while (static_cast<int>(result.closed.size()) < frames) {
    Stopwatch watch;
    const std::optional<Exposure> exposure = lab.advance();
    if (arm_watcher) arm_watcher(lab.arm().state());
    watchTrajectory();
    const double render_s = watch.seconds();
    watch = Stopwatch();
    person.start(lab.now_us());
    const auto report = servo.answer(lab.now_us());
    if (!exposure) continue;
    if (!report) throw std::runtime_error("the loop did not answer a frame");
    ClosedLoopFrame row = describe(*report);
    row.answer_s = watch.seconds() - report->learning_s;
    row.render_s = render_s;
    row.joints = exposure->state.joints;
    observer.observe(lab, row);
    if (trajectory) row.table_excursion_m = trajectory->table_m();
    if (trajectory) row.target_excursion_m = trajectory->target_m();
    result.closed.push_back(row);
    if (watcher) watcher(*exposure, *report, row);
    if (result.closed.size() == 1 || static_cast<int>(result.closed.size()) == frames) {
      const Pose T_camera_model = loop.carm.T_camera_patient(row.joints) * loop.T_dsa_cb;
      result.last = ClosedLoopSnapshot{exposure->frame, report->observation.centerline, T_camera_model,
                                       report->observation.registration,
                                       T_camera_model.linear() * world.truth.R_lps_model.transpose()};
      if (!result.first) result.first = result.last;
    }
  }
  while (!lab.advance()) watchTrajectory();  // What the last command still does.
  watchTrajectory();
  if (trajectory) result.max_table_excursion_m = trajectory->maxTable_m();
  if (trajectory) result.max_target_excursion_m = trajectory->maxTarget_m();
  result.closed_end = observer.error(lab.arm().state().joints, lab);
}

void runOpen(const VesselTree& tree, const Scenario& world, const ScenarioSettings& s, const ServoLoopSettings& loop,
             const SimulatedPatientSettings& patient, ClosedLoopRun& result) {
  ScenarioSettings blind = s;
  blind.lab.images = false;
  SimulatedLab lab = labOf(tree, world, blind, loop, patient);
  OpenLoop servo(loop, tree);
  Observer observer(world, servo.task(), loop, tree, patient);
  const int frames = framesOf(s);
  while (static_cast<int>(result.open.size()) < frames) {
    const std::optional<Exposure> exposure = lab.advance();
    if (!exposure) continue;
    ClosedLoopFrame row;
    row.command = servo.step(exposure->state, lab.period_s());
    publish(lab.loopSide(), kCArmCommandChannel, row.command);
    row.joints = exposure->state.joints;
    observer.observe(lab, row);
    result.open.push_back(row);
  }
  while (!lab.advance()) continue;
  result.open_end = observer.error(lab.arm().state().joints, lab);
}

}  // namespace

Scenario randomScenario(const VesselTree& tree, const CArmCalibration& nominal, const ScenarioSettings& s,
                        const ViewAngles& beam) {
  checkSettings("scenario", s);
  nominal.check("calibration");
  std::mt19937_64 engine(static_cast<std::uint64_t>(s.seed));
  const Eigen::Vector3d target = tree.centroid();
  Scenario world;
  world.truth = miscalibrated(nominal, target, randomDirection(engine), degToRad(s.patient_turn_deg),
                              s.patient_shift_mm * 1e-3 * randomDirection(engine));
  // An error about the beam would only turn the picture, which no joint answers for: the axis lies across the beam.
  const Pose desired = desiredPose({beam, target, nominal.R_lps_model}, nominal.carm.source_isocenter_distance_m);
  const Eigen::Vector3d beam_patient = world.truth.T_dsa_cb.linear() * desired.linear().row(2).transpose();
  const Eigen::Vector3d axis = beam_patient.cross(randomDirection(engine)).normalized();
  world.calibrated = miscalibrated(world.truth, target, axis, degToRad(s.calibration_error_deg),
                                   s.calibration_error_mm * 1e-3 * randomDirection(engine));
  world.calibrated.records.clear();  // They say how sure one may be of what was right.
  return world;
}

Eigen::Vector2d drawnAngles_deg(std::mt19937_64& engine, double max_primary_deg, double max_secondary_deg) {
  const auto symmetric = [&] { return 2 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1; };
  const double primary_deg = symmetric() * max_primary_deg;
  return {primary_deg, symmetric() * max_secondary_deg};
}

std::pair<ViewAngles, ViewAngles> drawViews(std::mt19937_64& engine, double max_primary_deg, double max_secondary_deg,
                                            ScenarioSettings& scenario, ServoLoopSettings& loop) {
  const auto drawn = [&] {
    const Eigen::Vector2d angles_deg = drawnAngles_deg(engine, max_primary_deg, max_secondary_deg);
    return ViewAngles{degToRad(angles_deg[0]), degToRad(angles_deg[1])};
  };
  const ViewAngles start = drawn(), goal = drawn();
  scenario.start_primary_deg = radToDeg(start.primary_rad);
  scenario.start_secondary_deg = radToDeg(start.secondary_rad);
  const auto* settings = std::get_if<ViewTaskSettings>(&loop.task);
  ViewTaskSettings view = settings ? *settings : ViewTaskSettings();
  view.goal = ViewGoal::kAngles;
  view.primary_deg = radToDeg(goal.primary_rad);
  view.secondary_deg = radToDeg(goal.secondary_rad);
  loop.task = view;
  return {start, goal};
}

CArmCalibration withDetectorPixels(CArmCalibration calibration, int side_px) {
  CArmGeometry& carm = calibration.carm;
  carm.pixel_spacing_m *= static_cast<double>(carm.image_width_px) / side_px;
  carm.image_width_px = carm.image_height_px = side_px;
  return calibration;
}

ServoLoopSettings loopIn(const Scenario& world, const ServoLoopSettings& parts) {
  const ExternalInputs told = parts.externalInputs();
  if (told.registration) throw InputError("scenario", "perception", "bus", "needs a bus with a perception node on it");
  if (told.tip) throw InputError("scenario", "centre.on", "catheter_tip", "needs a bus with a catheter's loop on it");
  ServoLoopSettings loop = parts;
  loop.carm = world.calibrated.carm;
  loop.T_dsa_cb = world.calibrated.T_dsa_cb;
  loop.R_lps_model = world.truth.R_lps_model;
  return loop;
}

SimulatedLab labOf(const VesselTree& tree, const Scenario& world, const ScenarioSettings& settings,
                   const ServoLoopSettings& loop, const SimulatedPatientSettings& patient,
                   const std::optional<LabCatheter>& catheter) {
  LabWorld lab;
  lab.carm = world.truth.carm;
  lab.limits = loop.limits;
  lab.T_patient_model = world.truth.T_dsa_cb;
  lab.start = loop.carm.jointsFor(startAngles(settings), loop.T_dsa_cb * targetOf(loop, tree));
  lab.claimed_camera = loop.carm.camera();
  lab.catheter = catheter;
  SimulatedPatientSettings seeded = patient;
  seeded.fluoroscopy.seed = settings.seed;
  return SimulatedLab(tree, seeded, lab, settings.lab);
}

ClosedLoopRun runClosedLoop(const VesselTree& tree, const Scenario& world, const ScenarioSettings& settings,
                            const ServoLoopSettings& parts, const SimulatedPatientSettings& patient,
                            const ClosedLoopObserver& watcher, const ArmWatcher& arm_watcher) {
  checkSettings("scenario", settings);
  world.truth.check("truth");
  world.calibrated.check("calibration");
  const ServoLoopSettings loop = loopIn(world, parts);
  ClosedLoopRun result;
  runClosed(tree, world, settings, loop, patient, watcher, arm_watcher, result);
  runOpen(tree, world, settings, loop, patient, result);
  result.predicted = viewUncertainty(world.calibrated, result.open.back().joints, tree.centroid());
  return result;
}

std::optional<double> settlingTime_s(const ClosedLoopRun& run) {
  const auto within = [](const ViewError& e) {
    return radToDeg(e.direction_rad) <= kViewWithin_deg && 1e3 * e.target_m <= kViewWithin_mm;
  };
  if (!run.has_view || !within(run.closed_end)) return std::nullopt;
  std::optional<double> settled_s;
  for (const auto& frame : run.closed) {
    if (!within(frame.true_error)) {
      settled_s.reset();
    } else if (!settled_s) {
      settled_s = frame.time_s - run.closed.front().time_s;
    }
  }
  return settled_s;
}

int framesOf(const ScenarioSettings& settings) {
  return static_cast<int>(std::ceil(settings.duration_s * settings.lab.frame_rate_hz));
}

}  // namespace angio::experiments

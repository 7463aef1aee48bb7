// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rehearsal/rehearsal.hpp"

#include <chrono>
#include <cmath>
#include <random>

#include "angio/base/stopwatch.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/simulation/nodes.hpp"

namespace angio {
namespace {

// Uniform on the sphere, the same on every machine.
Eigen::Vector3d randomDirection(std::mt19937_64& engine) {
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const double z = 2 * uniform() - 1, angle = 2 * kPi * uniform(), r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

// The truth of one rehearsal, and what the loop is told of it.
struct Stage {
  CArmCalibration truth;
  ServoLoopSettings loop;
  CArmJoints start;
  Pose desired_T_camera_model;

  Pose T_camera_model(const CArmJoints& joints) const { return truth.carm.T_camera_patient(joints) * truth.T_dsa_cb; }
};

DesiredView viewOf(const VesselTree& tree, const Eigen::Matrix3d& R_lps_model, const RehearsalSettings& s) {
  return {{degToRad(s.view_primary_deg), degToRad(s.view_secondary_deg)}, tree.centroid(), R_lps_model};
}

Stage setStage(const VesselTree& tree, const RehearsalWorld& world, const RehearsalSettings& s,
               const ServoLoopSettings& parts) {
  Stage stage;
  stage.truth = world.truth;
  stage.loop = parts;
  stage.loop.carm = world.believed.carm;
  stage.loop.T_dsa_cb = world.believed.T_dsa_cb;
  stage.loop.view = viewOf(tree, world.truth.R_lps_model, s);
  stage.desired_T_camera_model = desiredPose(stage.loop.view, stage.loop.carm.source_isocentre_distance_m);
  stage.start = stage.loop.carm.jointsFor({degToRad(s.start_primary_deg), degToRad(s.start_secondary_deg)},
                                          stage.loop.T_dsa_cb * tree.centroid());
  return stage;
}

class Times {
 public:
  explicit Times(const RehearsalSettings& s)
      : period_us_(1e6 / s.frame_rate_hz),
        latency_us_(std::min(std::llround(s.command_latency_ms * 1e3), std::llround(period_us_))),
        frames_(static_cast<int>(std::ceil(s.duration_s * s.frame_rate_hz))) {}

  int frames() const { return frames_; }
  std::int64_t exposure_us(int k) const { return std::llround((k + 1) * period_us_); }
  std::int64_t arrival_us(int k) const { return exposure_us(k) + latency_us_; }
  double period_s() const { return period_us_ * 1e-6; }

 private:
  double period_us_;
  std::int64_t latency_us_;
  int frames_;
};

constexpr std::chrono::milliseconds kNoWait(0);

RehearsalFrame describe(const ServoReport& report) {
  RehearsalFrame row;
  row.command = report.command;
  row.seen_error = report.view_error;
  row.held = report.held;
  row.status = report.registration.status;
  row.model_residual_px = report.registration.agreement.model_residual_px;
  row.image_residual_px = report.registration.agreement.image_residual_px;
  row.points_2d = report.centerline.size();
  row.image_s = report.image_s;
  row.registration_s = report.registration_s;
  row.control_s = report.control_s;
  return row;
}

void runClosed(const VesselTree& tree, const Stage& stage, const Times& times, const FluoroscopySettings& fluoroscopy,
               const RehearsalProgress& progress, Rehearsal& result) {
  const auto bus = openBus("memq://");
  SimulatedCArmNode arm(*bus, stage.loop.limits, stage.start, 0);
  SimulatedXrayNode xray(*bus, tree, fluoroscopy, stage.truth.carm, stage.truth.T_dsa_cb, stage.loop.carm.camera());
  ServoNode servo(*bus, stage.loop, tree);
  const auto trueError = [&](const CArmJoints& joints) {
    return viewError(stage.T_camera_model(joints), stage.desired_T_camera_model, stage.loop.view.target_model);
  };

  for (int k = 0; k < times.frames(); ++k) {
    arm.report(times.exposure_us(k));
    bus->handle(kNoWait);
    Stopwatch watch;
    const std::optional<XrayFrame> frame = xray.expose(times.exposure_us(k));
    const double render_s = watch.seconds();
    const CArmJoints joints = arm.arm().state().joints;

    watch = Stopwatch();
    bus->handle(kNoWait);
    const auto report = servo.answer();
    if (!report) throw std::runtime_error("the loop did not answer a frame");
    RehearsalFrame row = describe(*report);
    row.answer_s = watch.seconds();
    row.render_s = render_s;
    row.time_s = 1e-6 * static_cast<double>(times.exposure_us(k));
    row.joints = joints;
    row.true_error = trueError(joints);
    result.closed.push_back(row);

    if (k == 0 || k + 1 == times.frames()) {
      RehearsalSnapshot snapshot{*frame, report->centerline,
                                 stage.loop.carm.T_camera_patient(joints) * stage.loop.T_dsa_cb, report->registration};
      (k == 0 ? result.first : result.last) = snapshot;
      if (times.frames() == 1) result.last = snapshot;
    }
    bus->handle(kNoWait);
    arm.listen(times.arrival_us(k));
    if (progress) progress(k + 1, times.frames());
  }
  arm.report(times.exposure_us(times.frames()));
  result.closed_end = trueError(arm.arm().state().joints);
}

void runOpen(const Stage& stage, const Times& times, Rehearsal& result) {
  const auto bus = openBus("memq://");
  SimulatedCArmNode arm(*bus, stage.loop.limits, stage.start, 0);
  LatestValue<CArmState> states(*bus, kCArmStateChannel);
  OpenLoop loop(stage.loop);
  const auto trueError = [&](const CArmJoints& joints) {
    return viewError(stage.T_camera_model(joints), stage.desired_T_camera_model, stage.loop.view.target_model);
  };
  for (int k = 0; k < times.frames(); ++k) {
    arm.report(times.exposure_us(k));
    bus->handle(kNoWait);
    const CArmState state = *states.take();
    RehearsalFrame row;
    row.command = loop.step(state, times.period_s());
    row.time_s = 1e-6 * static_cast<double>(times.exposure_us(k));
    row.joints = state.joints;
    row.true_error = trueError(state.joints);
    result.open.push_back(row);
    publish(*bus, kCArmCommandChannel, row.command);
    bus->handle(kNoWait);
    arm.listen(times.arrival_us(k));
  }
  arm.report(times.exposure_us(times.frames()));
  result.open_end = trueError(arm.arm().state().joints);
}

}  // namespace

RehearsalWorld madeUpWorld(const VesselTree& tree, const CArmCalibration& nominal, const RehearsalSettings& s) {
  checkSettings("rehearsal", s);
  nominal.check("calibration");
  std::mt19937_64 engine(static_cast<std::uint64_t>(s.seed));
  const Eigen::Vector3d target = tree.centroid();
  RehearsalWorld world;
  world.truth = miscalibrated(nominal, target, randomDirection(engine), degToRad(s.patient_turn_deg),
                              s.patient_shift_mm * 1e-3 * randomDirection(engine));
  // An error about the beam would only turn the picture, which no joint answers for: the axis lies across the beam.
  const Pose desired = desiredPose(viewOf(tree, nominal.R_lps_model, s), nominal.carm.source_isocentre_distance_m);
  const Eigen::Vector3d beam_patient = world.truth.T_dsa_cb.linear() * desired.linear().row(2).transpose();
  const Eigen::Vector3d axis = beam_patient.cross(randomDirection(engine)).normalized();
  world.believed = miscalibrated(world.truth, target, axis, degToRad(s.calibration_error_deg),
                                 s.calibration_error_mm * 1e-3 * randomDirection(engine));
  world.believed.records.clear();  // They say how sure one may be of what was right.
  return world;
}

Rehearsal rehearse(const VesselTree& tree, const RehearsalWorld& world, const RehearsalSettings& settings,
                   const ServoLoopSettings& loop, const FluoroscopySettings& fluoroscopy,
                   const RehearsalProgress& progress) {
  checkSettings("rehearsal", settings);
  world.truth.check("truth");
  world.believed.check("calibration");
  const Stage stage = setStage(tree, world, settings, loop);
  const Times times(settings);
  FluoroscopySettings seeded = fluoroscopy;
  seeded.seed = settings.seed;
  Rehearsal result;
  runClosed(tree, stage, times, seeded, progress, result);
  runOpen(stage, times, result);
  result.predicted = viewUncertainty(world.believed, result.open.back().joints, tree.centroid());
  return result;
}

}  // namespace angio

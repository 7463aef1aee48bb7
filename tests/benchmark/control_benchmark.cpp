// SPDX-License-Identifier: GPL-2.0-or-later
// What is left to do for a command once a frame has been looked at: gates, task, law, limits. And the look.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>

#include "angio/benchmarks/namespace.hpp"
#include "angio/perception/perception.hpp"
#include "angio/perception/registration_gate.hpp"
#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/servo/tasks.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/simulation/patient_motion.hpp"
#include "scene.hpp"

namespace angio::benchmarks {
namespace {

constexpr std::int64_t kPeriod_us = 66'667;
constexpr double kLatency_s = 0.08;

// Of this thread alone: other programs' time is not the law's.
double cpu_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

// At rest, or with breaths of 15 mm that differ and a heartbeat of 2 mm: what there is to be learnt, and searched for.
PatientMotion motionOf(const Scene& scene, bool moving) {
  MotionSettings settings;
  if (moving) {
    settings.breathing.amplitude_mm = 15;
    settings.breathing.diaphragm_mm = 0;
    settings.heartbeat.amplitude_mm = 2;
    settings.heartbeat.center_mm[2] = 50;
  }
  return PatientMotion(settings, scene.tree.centroid(), Eigen::Matrix3d::Identity(), 1);
}

// Registrations of a patient, a tenth of a millimetre from the truth, and an arm on its way; range(0) 1: who moves.
template <typename Settings>
void control(benchmark::State& state) {
  const Scene scene;
  const CArmLimits limits =
      CArmLimits::typical(scene.carm.source_detector_distance_m - scene.carm.source_isocenter_distance_m);
  const Eigen::Vector3d target = scene.tree.centroid();
  const PatientMotion motion = motionOf(scene, state.range(0) == 1);
  const auto task = makeTask(
      Settings(), {scene.carm, limits, scene.tree, target, Eigen::Matrix3d::Identity(), PositionBasedSettings()});
  const RegistrationGateSettings gate_settings;
  const RegistrationGate gate(gate_settings, target);
  CArmMotionLimiter limiter(limits, 1e-3 * gate_settings.command_valid_ms);
  XrayFrame frame{0, 0, cv::Mat(scene.camera.height_px(), scene.camera.width_px(), CV_16UC1), scene.camera};
  CArmState arm;
  arm.joints = scene.carm.jointsFor({degToRad(30), degToRad(15)}, target);
  RegistrationResult seen;
  seen.status = RegistrationStatus::kConverged;
  Vector6d std_dev;
  std_dev << 1e-4, 1e-4, 1e-3, 1e-4, 1e-4, 1e-4;
  seen.covariance = std_dev.cwiseAbs2().asDiagonal();
  test::Random random(3);
  CArmJoints last = CArmJoints::Zero();
  int held = 0;
  double learnt_us = 0;  // The longest that is done after an answer, before the next frame.
  std::vector<double> took_us;
  for (auto _ : state) {
    state.PauseTiming();
    frame.time_us = arm.time_us += kPeriod_us;
    const Pose truth =
        scene.truth * Eigen::Translation3d(motion.displacement(target, 1e-6 * static_cast<double>(frame.time_us)));
    seen.T_camera_model = truth;
    seen.T_camera_model.translation() += 1e-4 * random.direction();
    state.ResumeTiming();
    const double begin_us = cpu_us();
    const bool objected = gate.rejection(frame, arm) || gate.rejection(seen, scene.truth, truth);
    TaskInput input{frame.time_us, frame.camera, seen.T_camera_model, *seen.covariance, truth, arm};
    input.last_velocity = last;
    input.period_s = 1e-6 * kPeriod_us;
    input.latency_s = kLatency_s;
    const TaskAnswer answer = task->answer(input);
    held += objected || !answer.velocity;
    if (answer.velocity) last = limiter.limit(*answer.velocity, arm.joints, kLatency_s, input.period_s);
    benchmark::DoNotOptimize(last);
    took_us.push_back(cpu_us() - begin_us);
    state.PauseTiming();
    const double learning_us = cpu_us();
    task->learn();
    learnt_us = std::max(learnt_us, cpu_us() - learning_us);
    state.ResumeTiming();
  }
  state.counters["held"] = held;
  state.counters["learnt_us"] = learnt_us;
  std::sort(took_us.begin(), took_us.end());
  state.counters["p50_us"] = took_us[took_us.size() / 2];
  state.counters["p99_us"] = took_us[took_us.size() * 99 / 100];
  state.counters["worst_us"] = took_us.back();
}
// A minute of frames; the motion is learnt between them.
BENCHMARK(control<ViewTaskSettings>)->ArgName("moving")->Arg(0)->Iterations(900)->Unit(benchmark::kMicrosecond);
BENCHMARK(control<CenterTaskSettings>)
    ->ArgName("moving")
    ->Arg(0)
    ->Arg(1)
    ->Iterations(900)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(control<HoldTaskSettings>)->ArgName("moving")->Arg(0)->Arg(1)->Iterations(900)->Unit(benchmark::kMicrosecond);

// A frame's registration as a tracked one has it; with `watched` 1 the image around the target is looked at besides.
void perceive(benchmark::State& state) {
  const Scene scene;
  CArmState arm;
  arm.joints = scene.carm.jointsFor({degToRad(30), degToRad(15)}, scene.tree.centroid());
  FluoroscopyRenderer renderer(scene.tree, FluoroscopySettings());
  const XrayFrame frame{0, 1, renderer.render(scene.camera, scene.truth, 0), scene.camera};
  std::optional<PointOfInterest> place;
  if (state.range(0) == 1) {
    const CenterTaskSettings center;
    place = PointOfInterest{scene.tree.points().col(scene.tree.size() / 2), 1e-3 * center.near_mm,
                            1e-3 * center.near_std_mm};
  }
  Perception perception(PerceptionSettings(), scene.carm, Pose::Identity(), scene.tree, place);
  const Observation first = perception.observe(frame, arm);
  perception.accept(first, arm);
  int seen = 0;
  for (auto _ : state) {
    const Observation sight = perception.observe(frame, arm);
    seen += sight.place && sight.place->image_shift;
  }
  state.counters["seen"] = seen;
}
BENCHMARK(perceive)->ArgName("watched")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angio::benchmarks

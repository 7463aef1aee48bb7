// SPDX-License-Identifier: GPL-2.0-or-later
// What is left to do for a command once a frame is registered: gates, task, law, limits.
#include <benchmark/benchmark.h>

#include "angio/servo/supervisor.hpp"
#include "angio/servo/tasks.hpp"
#include "scene.hpp"

namespace angio::benchmarks {
namespace {

constexpr std::int64_t kPeriod_us = 66'667;
constexpr double kLatency_s = 0.08;

// Registrations of a patient at rest, a tenth of a millimetre from each other, and an arm on its way.
template <typename Settings>
void control(benchmark::State& state) {
  const Scene scene;
  const CArmLimits limits =
      CArmLimits::typical(scene.carm.source_detector_distance_m - scene.carm.source_isocentre_distance_m);
  const Eigen::Vector3d target = scene.tree.centroid();
  const auto task = makeTask(
      Settings(), {scene.carm, limits, scene.tree, target, Eigen::Matrix3d::Identity(), PositionBasedSettings()});
  Supervisor supervisor(SupervisorSettings(), limits, target);
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
  for (auto _ : state) {
    frame.time_us = arm.time_us += kPeriod_us;
    seen.T_camera_model = scene.truth;
    seen.T_camera_model.translation() += 1e-4 * random.direction();
    const bool objected = supervisor.objection(frame, arm) || supervisor.objection(seen, scene.truth, scene.truth);
    TaskInput input{frame.time_us, frame.camera, seen.T_camera_model, *seen.covariance, scene.truth, arm};
    input.last_velocity = last;
    input.period_s = 1e-6 * kPeriod_us;
    input.latency_s = kLatency_s;
    input.centerline = &scene.image;
    const TaskAnswer answer = task->answer(input);
    held += objected || !answer.velocity;
    if (answer.velocity) last = supervisor.limit(*answer.velocity, arm, kLatency_s, input.period_s);
    benchmark::DoNotOptimize(last);
  }
  state.counters["held"] = held;
}
BENCHMARK(control<ViewTaskSettings>)->Unit(benchmark::kMicrosecond);
BENCHMARK(control<CentreTaskSettings>)->Unit(benchmark::kMicrosecond);
BENCHMARK(control<HoldTaskSettings>)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace angio::benchmarks

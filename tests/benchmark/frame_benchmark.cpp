// SPDX-License-Identifier: GPL-2.0-or-later
// The stages of a frame before and after the registration: making it, sending it, finding its centrelines.
#include <benchmark/benchmark.h>

#include "angio/benchmarks/namespace.hpp"
#include "angio/imaging/extractor.hpp"
#include "angio/messaging/codec.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/simulation/simulated_patient.hpp"
#include "scene.hpp"

namespace angio::benchmarks {
namespace {

void renderFrame(benchmark::State& state) {
  const Scene scene;
  FluoroscopyRenderer renderer(scene.tree, FluoroscopySettings());
  std::uint64_t frame = 0;
  for (auto _ : state) {
    const cv::Mat image = renderer.render(scene.camera, scene.truth, frame++);
    benchmark::DoNotOptimize(image.data);
  }
}
BENCHMARK(renderFrame)->Unit(benchmark::kMillisecond);

// Everything that a simulated patient can have.
SimulatedPatientSettings everything(int threads) {
  SimulatedPatientSettings settings;
  settings.fluoroscopy.threads = threads;
  settings.fluoroscopy.dose = Dose::kCine;
  settings.fluoroscopy.detector.lag = 0.1;
  settings.fluoroscopy.collimator.shutter = Shutter::kOctagon;
  settings.fluoroscopy.intensifier.pincushion = 0.05;
  settings.fluoroscopy.intensifier.s_distortion_deg = 2;
  settings.bolus.enabled = true;
  settings.motion.breathing.amplitude_mm = 15;
  settings.motion.heartbeat.amplitude_mm = 3;
  settings.device.kind = DeviceKind::kCatheter;
  return settings;
}

// Of a patient who breathes; with `turning` 1 the C-arm turns too, so that the anatomy is cast anew for each frame.
void renderEverything(benchmark::State& state) {
  const Scene scene;
  SimulatedPatient patient(scene.tree, everything(static_cast<int>(state.range(0))));
  std::uint64_t frame = 0;
  Pose T = scene.truth;
  patient.render(scene.camera, patient.scene(T, 2), frame);  // What is made once for a detector.
  for (auto _ : state) {
    const double time_s = 2 + static_cast<double>(frame) / 15;
    if (state.range(1) == 1)
      T = scene.truth * Eigen::AngleAxisd(1e-3 * static_cast<double>(frame % 100), Eigen::Vector3d::UnitY());
    const cv::Mat image = patient.render(scene.camera, patient.scene(T, time_s), frame++);
    benchmark::DoNotOptimize(image.data);
  }
}
BENCHMARK(renderEverything)
    ->ArgNames({"threads", "turning"})
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

// What each part of a frame adds: a row without it.
void renderWithout(benchmark::State& state, void (*leave_out)(SimulatedPatientSettings&)) {
  const Scene scene;
  SimulatedPatientSettings settings = everything(1);
  leave_out(settings);
  SimulatedPatient patient(scene.tree, settings);
  std::uint64_t frame = 0;
  patient.render(scene.camera, patient.scene(scene.truth, 3), frame);  // What is made once for a detector.
  for (auto _ : state) {
    const cv::Mat image = patient.render(scene.camera, patient.scene(scene.truth, 3), frame++);
    benchmark::DoNotOptimize(image.data);
  }
}
BENCHMARK_CAPTURE(renderWithout, nothing, [](SimulatedPatientSettings&) {})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, device, [](SimulatedPatientSettings& s) {
  s.device.kind = DeviceKind::kNone;
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, scatter, [](SimulatedPatientSettings& s) {
  s.fluoroscopy.detector.scatter_to_primary = 0;
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, focal_spot, [](SimulatedPatientSettings& s) {
  s.fluoroscopy.detector.focal_spot_mm = 0;
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, light_spread, [](SimulatedPatientSettings& s) {
  s.fluoroscopy.detector.psf_std_mm = 0;
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, distortion, [](SimulatedPatientSettings& s) {
  s.fluoroscopy.intensifier = {};
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, electronic_noise, [](SimulatedPatientSettings& s) {
  s.fluoroscopy.electronic_noise_photons = 0;
})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(renderWithout, shutter, [](SimulatedPatientSettings& s) {
  s.fluoroscopy.collimator = {};
})->Unit(benchmark::kMillisecond);

void segmentOtsu(benchmark::State& state) {
  const Scene scene;
  FluoroscopyRenderer renderer(scene.tree, FluoroscopySettings());
  const cv::Mat image = renderer.render(scene.camera, scene.truth, 0);
  const auto extractor = makeExtractor(OtsuSettings());
  int points = 0;
  for (auto _ : state) points = extractor->extract(image).size();
  state.counters["points_2d"] = points;
}
BENCHMARK(segmentOtsu)->Unit(benchmark::kMillisecond);

XrayFrame renderedFrame(const Scene& scene) {
  FluoroscopyRenderer renderer(scene.tree, FluoroscopySettings());
  return {1000, 1, renderer.render(scene.camera, scene.truth, 0), scene.camera};
}

void encodeFrame(benchmark::State& state) {
  const XrayFrame frame = renderedFrame(Scene());
  for (auto _ : state) benchmark::DoNotOptimize(encode(frame).data());
}
BENCHMARK(encodeFrame)->Unit(benchmark::kMillisecond);

void decodeFrame(benchmark::State& state) {
  const std::vector<std::uint8_t> bytes = encode(renderedFrame(Scene()));
  for (auto _ : state) {
    const auto decoded = decode<XrayFrame>(bytes.data(), bytes.size());
    if (!decoded.value) state.SkipWithError(decoded.error.c_str());
  }
}
BENCHMARK(decodeFrame)->Unit(benchmark::kMillisecond);

// From the frame to its command, once the tree is tracked.
void wholeFrame(benchmark::State& state) {
  const Scene scene;
  ServoLoopSettings settings;
  settings.T_dsa_cb = settings.carm.T_camera_patient(CArmJoints::Zero()).inverse() * scene.truth;
  ServoLoop loop(settings, scene.tree);
  XrayFrame frame = renderedFrame(scene);
  CArmState joints;
  int held = 0;
  joints.time_us = frame.time_us;
  if (loop.step(frame, joints).hold_reason) state.SkipWithError("the tree was not found");
  for (auto _ : state) {
    frame.time_us += 66667;
    ++frame.sequence;
    joints.time_us = frame.time_us;
    held += loop.step(frame, joints).hold_reason.has_value();
  }
  state.counters["held"] = held;
}
BENCHMARK(wholeFrame)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angio::benchmarks

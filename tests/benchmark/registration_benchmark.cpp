// SPDX-License-Identifier: GPL-2.0-or-later
#include <benchmark/benchmark.h>

#include "angio/registration/agreement.hpp"
#include "angio/registration/registration.hpp"
#include "point_matcher.hpp"
#include "scene.hpp"

namespace angio::benchmarks {
namespace {

constexpr int kPoints = 2000;  // On either side.

// The points as they are: spacing is the benchmark's business.
IterativePnpSettings withPrior(PriorForm prior) {
  IterativePnpSettings settings;
  settings.prior = prior;
  settings.spacing_mm = settings.spacing_px = 0;
  settings.most_points_3d = 100000;
  return settings;
}

void count(benchmark::State& state, const VesselTree& tree, const Centerline2d& image) {
  state.counters["points_3d"] = tree.size();
  state.counters["points_2d"] = image.size();
}

void buildKdTree(benchmark::State& state) {
  const Scene scene;
  const Centerline2d image = scene.imageOf(kPoints);
  for (auto _ : state) {
    PointMatcher matcher(image.points_px);
    benchmark::DoNotOptimize(matcher.size());
  }
  state.counters["points_2d"] = image.size();
}
BENCHMARK(buildKdTree)->Unit(benchmark::kMicrosecond);

void sweepNearest(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(kPoints);
  const Centerline2d image = scene.imageOf(kPoints);
  const PointMatcher matcher(image.points_px);
  const Pose start = scene.start(1, 3);
  for (auto _ : state) {
    double sum = 0;
    for (int i = 0; i < tree.size(); ++i) {
      sum += matcher.nearest(*scene.camera.project(start * tree.points().col(i)), -1).distance2_px2;
    }
    benchmark::DoNotOptimize(sum);
  }
  count(state, tree, image);
}
BENCHMARK(sweepNearest)->Unit(benchmark::kMicrosecond);

void align(benchmark::State& state, const IterativePnpSettings& settings, double rotation_deg, double translation_mm,
           int points_3d) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(points_3d);
  const Centerline2d image = scene.imageOf(kPoints);
  const auto registration = makeRegistration(settings, tree);
  const PosePrior prior{scene.start(rotation_deg, translation_mm), std::nullopt};
  RegistrationResult result;
  for (auto _ : state) {
    result = registration->align(image, scene.camera, prior);
    benchmark::DoNotOptimize(result);
  }
  count(state, tree, image);
  state.counters["rigid_ms"] = 1e3 * result.times.rigid_s;
  state.counters["nonrigid_ms"] = 1e3 * result.times.nonrigid_s;
  state.counters["iterations"] = result.rigid_iterations + result.nonrigid_iterations;
  state.counters["residual_px"] = result.agreement.model_residual_px;
  state.SetLabel(statusName(result.status));
}

IterativePnpSettings nonrigid(IterativePnpSettings settings) {
  settings.deformation = Deformation::kNonrigid;
  return settings;
}

const IterativePnpSettings kPaper = withPrior(PriorForm::kPaper), kCovariance = withPrior(PriorForm::kCovariance);

BENCHMARK_CAPTURE(align, rigid_1deg_3mm_covariance, kCovariance, 1, 3, kPoints)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, rigid_1deg_3mm_paper, kPaper, 1, 3, kPoints)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, rigid_2deg_5mm_covariance, kCovariance, 2, 5, kPoints)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, rigid_2deg_5mm_paper, kPaper, 2, 5, kPoints)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, nonrigid_2deg_5mm_covariance, nonrigid(kCovariance), 2, 5, kPoints)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, nonrigid_2deg_5mm_paper, nonrigid(kPaper), 2, 5, kPoints)->Unit(benchmark::kMillisecond);

void rigidByModelSize(benchmark::State& state) {
  align(state, kCovariance, 1, 3, static_cast<int>(state.range(0)));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(rigidByModelSize)->RangeMultiplier(2)->Range(500, 8000)->Unit(benchmark::kMillisecond)->Complexity();

void agreement(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(kPoints);
  const Centerline2d image = scene.imageOf(kPoints);
  for (auto _ : state) {
    benchmark::DoNotOptimize(agreementOf(tree, tree.points(), image, scene.camera, scene.truth).score());
  }
  count(state, tree, image);
}
BENCHMARK(agreement)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angio::benchmarks

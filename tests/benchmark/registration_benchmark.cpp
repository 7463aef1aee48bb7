// SPDX-License-Identifier: GPL-2.0-or-later
#include <benchmark/benchmark.h>

#include "angio/benchmarks/namespace.hpp"
#include "angio/registration/alignment_score.hpp"
#include "angio/registration/registration.hpp"
#include "field_step.hpp"
#include "oriented_frame.hpp"
#include "oriented_model.hpp"
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
  settings.max_points_3d = 100000;
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
      PointMatcher::Nearby nearby;
      sum += matcher.nearest(*scene.camera.project(start * tree.points().col(i)), nearby).distance2_px2;
    }
    benchmark::DoNotOptimize(sum);
  }
  count(state, tree, image);
}
BENCHMARK(sweepNearest)->Unit(benchmark::kMicrosecond);

void align(benchmark::State& state, const RegistrationSettings& settings, double rotation_deg, double translation_mm,
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
  state.counters["residual_px"] = result.alignment.model_residual_px;
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

// The methods that the paper compares with, as they come.
BENCHMARK_CAPTURE(align, dt_icp_2deg_5mm, DtIcpSettings{}, 2, 5, kPoints)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, nicp_2deg_5mm, NicpSettings{}, 2, 5, kPoints)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, cvo_2deg_5mm, CvoSettings{}, 2, 5, kPoints)->Unit(benchmark::kMillisecond);

void rigidByModelSize(benchmark::State& state) {
  align(state, kCovariance, 1, 3, static_cast<int>(state.range(0)));
  state.SetComplexityN(state.range(0));
}
BENCHMARK(rigidByModelSize)->RangeMultiplier(2)->Range(500, 8000)->Unit(benchmark::kMillisecond)->Complexity();

// The points as they are, and the covariance that a tracker knows its prediction to: 1 deg, 3 mm.
OrientedKernelSettings oriented(Deformation deformation) {
  OrientedKernelSettings settings;
  settings.spacing_mm = 0;
  settings.max_points_3d = 100000;
  settings.prior_rotation_std_deg = 1;
  settings.prior_translation_std_mm = 3;
  settings.deformation = deformation;
  return settings;
}

BENCHMARK_CAPTURE(align, oriented_tracking_1deg_3mm, oriented(Deformation::kRigid), 1, 3, kPoints)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, oriented_nonrigid_1deg_3mm, oriented(Deformation::kNonrigid), 1, 3, kPoints)
    ->Unit(benchmark::kMillisecond);

void searchOriented(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(kPoints);
  const Centerline2d image = scene.imageOf(kPoints);
  OrientedKernelSettings settings = oriented(Deformation::kRigid);
  settings.prior_rotation_std_deg = 5;
  settings.prior_translation_std_mm = 10;
  settings.starts = static_cast<int>(state.range(0));
  const auto registration = makeRegistration(settings, tree);
  const PosePrior prior{scene.start(5, 10), std::nullopt};
  RegistrationResult result;
  for (auto _ : state) result = registration->search(image, scene.camera, prior, {});
  count(state, tree, image);
  state.counters["ambiguity"] = result.ambiguity.value_or(1);
  state.SetLabel(statusName(result.status));
}
BENCHMARK(searchOriented)->Arg(64)->Arg(128)->Arg(256)->Unit(benchmark::kMillisecond);

void boxOriented(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(kPoints);
  const Centerline2d image = scene.imageOf(kPoints);
  const auto registration = makeRegistration(oriented(Deformation::kRigid), tree);
  StartSettings box;
  box.box_rotation_deg = 45;
  box.box_translation_mm = 60;
  RegistrationResult result;
  for (auto _ : state) result = registration->search(image, scene.camera, {scene.start(30, 40), {}}, box);
  count(state, tree, image);
  state.SetLabel(statusName(result.status));
}
BENCHMARK(boxOriented)->Unit(benchmark::kMillisecond);

void buildField(benchmark::State& state) {
  const Scene scene;
  OrientedPoints points, thin;
  orientedPoints(scene.imageOf(kPoints), 2, 100000, points);
  const double scale = static_cast<double>(state.range(0));
  KernelField field;
  for (auto _ : state) {
    thinned(points, std::max(1, static_cast<int>(0.75 * scale / 2)), thin);
    field.build(thin, scale, KernelField::Region::detector(scene.camera.width_px(), scene.camera.height_px()));
    benchmark::DoNotOptimize(field.cells());
  }
}
BENCHMARK(buildField)->Arg(32)->Arg(16)->Arg(8)->Unit(benchmark::kMicrosecond);

// One sample of the field at all points: linear in the 3D points, whatever the 2D points are.
void sampleFieldBySize(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(static_cast<int>(state.range(0)));
  const OrientedModel model(tree, oriented(Deformation::kRigid));
  const Centerline2d image = scene.imageOf(kPoints);
  OrientedPoints points;
  orientedPoints(image, 2, 100000, points);
  KernelField field;
  field.build(points, 8, KernelField::Region::detector(scene.camera.width_px(), scene.camera.height_px()));
  std::vector<HalfPlane> view;
  fieldOfView(XrayView{image, scene.camera}, view);
  const Pose T = scene.start(1, 3) * Eigen::Translation3d(model.centroid);
  for (auto _ : state) {
    benchmark::DoNotOptimize(sampleField(model.all, field, scene.camera, view, T, {}).fit);
  }
  state.SetComplexityN(state.range(0));
}
BENCHMARK(sampleFieldBySize)->RangeMultiplier(2)->Range(500, 16000)->Unit(benchmark::kMicrosecond)->Complexity();

void alignment_score(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = scene.treeOf(kPoints);
  const Centerline2d image = scene.imageOf(kPoints);
  for (auto _ : state) {
    benchmark::DoNotOptimize(alignmentScore(tree, tree.points(), image, scene.camera, scene.truth).score());
  }
  count(state, tree, image);
}
BENCHMARK(alignment_score)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angio::benchmarks

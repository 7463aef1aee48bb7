// SPDX-License-Identifier: GPL-2.0-or-later
// A drive's steps of an elastic catheter in the vessels of a liver.
#include <benchmark/benchmark.h>

#include "angio/benchmarks/namespace.hpp"
#include "angio/rod/elastic_rod.hpp"
#include "angio/vessel/plausible_radii.hpp"
#include "scene.hpp"

namespace angio::benchmarks {
namespace {

// Pushed in by a millimetre and turned by 0.1 rad a step, 30 steps and back again, its tip bent, as far from the root
// as half of the way to the deepest branch. What a frame of 10 a second at 10 mm a second has.
void rodStep(benchmark::State& state) {
  const Scene scene;
  const VesselTree tree = withPlausibleRadii(scene.tree, 0.6e-3);
  const TreeTopology map(tree);
  int deepest = 0;
  for (int c = 0; c < map.branchCount(); ++c) {
    if (map.start_m(c) > map.start_m(deepest)) deepest = c;
  }
  rod::RodSettings settings;
  settings.radius_m = 0.35e-3;
  settings.shaft_bending_n_m2 = 3e-6;
  settings.tip_bending_n_m2 = 1e-6;
  settings.tip_length_m = 6e-3;
  settings.spacing_m = 1.5e-3;
  rod::ElasticRod rod(rod::Lumen(tree), settings, {map.before({deepest, 0}, 0.5 * map.start_m(deepest)), 0.5});
  int step = 0, iterations = 0, at_rest = 0;
  for (auto _ : state) {
    const double sign = step++ % 60 < 30 ? 1 : -1;
    rod.move({sign * 1e-3, sign * 0.1});
    iterations += rod.effort().iterations;
    at_rest += rod.effort().at_rest;
  }
  state.counters["points"] = static_cast<double>(rod.shape().size());
  state.counters["iterations"] = static_cast<double>(iterations) / step;
  state.counters["at_rest"] = static_cast<double>(at_rest) / step;
}
BENCHMARK(rodStep)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angio::benchmarks

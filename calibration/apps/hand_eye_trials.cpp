// SPDX-License-Identifier: GPL-2.0-or-later
// The figures of angio-calibrate hand-eye --simulate-trials.
#include <algorithm>
#include <cmath>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/statistics.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct Errors {
  std::vector<double> X_deg, X_mm, Z_deg, Z_mm;

  void add(double X_rad, double X_m, double Z_rad, double Z_m) {
    X_deg.push_back(radToDeg(X_rad));
    X_mm.push_back(1e3 * X_m);
    Z_deg.push_back(radToDeg(Z_rad));
    Z_mm.push_back(1e3 * Z_m);
  }
  std::string row(const std::string& name) const {
    const auto both = [](const std::vector<double>& v) {
      return formatted("  %8.4f (%8.4f)", percentile(v, 0.5), percentile(v, 0.95));
    };
    if (Z_mm.empty()) return formatted("%-24s  fails\n", name.c_str());
    return formatted("%-24s", name.c_str()) + both(Z_deg) + both(Z_mm) + both(X_deg) + both(X_mm) + "\n";
  }
};

// Our rows: how far off, and whether the covariance says so.
struct OurTrials {
  std::string row, nees;
};

OurTrials trialsWith(HandEyeMount mount, const std::string& name, const CArmGeometry& carm, const OrbitSettings& orbit,
                     HandEyeSettings settings, int trials, int seed) {
  settings.mount = mount;
  ProgressBar bar("calibrating", trials);
  Errors errors;
  double nees = 0;
  for (const HandEyeTrial& trial :
       handEyeTrials(carm, orbit, settings, trials, seed, [&](int done) { bar.show(done, name); })) {
    errors.add(trial.X_rad, trial.X_m, trial.Z_rad, trial.Z_m);
    nees += trial.nees / trials;
  }
  const double freedom = mount == HandEyeMount::kUnknown ? 12 : 6;
  const double band = 1.96 * std::sqrt(2 * freedom / trials);
  return {errors.row(name), formatted("NEES, %s: %.2f, %.0f by theory (95 %% band %.2f to %.2f)\n", name.c_str(), nees,
                                      freedom, freedom - band, freedom + band)};
}

std::string otherSolvers(const CArmGeometry& carm, const OrbitSettings& orbit, int trials, int seed) {
  ProgressBar bar("other solvers", trials);
  std::vector<std::pair<std::string, Errors>> others;
  for (int trial = 0; trial < trials; ++trial) {
    const SimulatedPoseSet simulated = simulatedOrbit(carm, orbit, seed + trial);
    for (const ComparedSolver& other : compareSolvers(handEyeEquations(simulated.set))) {
      auto at =
          std::find_if(others.begin(), others.end(), [&](const auto& entry) { return entry.first == other.name; });
      if (at == others.end()) at = others.insert(others.end(), {other.name, {}});
      if (!other.transforms) continue;
      const auto e = errorOf(*other.transforms, simulated.truth);
      at->second.add(e.segment<3>(3).norm(), e.segment<3>(0).norm(), e.segment<3>(9).norm(), e.segment<3>(6).norm());
    }
    bar.show(trial + 1);
  }
  std::string rows;
  for (const auto& [name, errors] : others) rows += errors.row(name);
  return rows;
}

}  // namespace

std::string trialsTable(const CArmGeometry& carm, const OrbitSettings& orbit, const HandEyeSettings& settings,
                        int trials, int seed, bool compare) {
  const OurTrials known =
      trialsWith(HandEyeMount::kIdentity, "angio, mount known", carm, orbit, settings, trials, seed);
  OurTrials unknown;
  if (settings.mount == HandEyeMount::kUnknown) {
    unknown = trialsWith(HandEyeMount::kUnknown, "angio, mount estimated", carm, orbit, settings, trials, seed);
  }
  std::string table = formatted(
      "%d trials of %d poses, LAO/RAO %g deg + CRA/CAU %g deg, noise %g deg, %g mm per axis; median (95th "
      "percentile)\n",
      trials, orbit.poses, orbit.max_primary_deg, orbit.max_secondary_deg, orbit.camera_noise_deg,
      orbit.camera_noise_mm);
  table += formatted("%-24s  %-19s  %-19s  %-19s  %-19s\n", "solver", "T_dsa_cb [deg]", "T_dsa_cb [mm]", "mount [deg]",
                     "mount [mm]");
  table += known.row + unknown.row;
  if (compare) table += otherSolvers(carm, orbit, trials, seed);
  return table + known.nees + unknown.nees;
}

}  // namespace angio::apps

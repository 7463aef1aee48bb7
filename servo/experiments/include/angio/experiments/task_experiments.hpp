// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/experiments/closed_loop.hpp"
#include "angio/results/campaign.hpp"

namespace angio::experiments {

/// Many runs, of the seeds first_seed, first_seed + 1, ...
struct Runs {
  int count = 100, first_seed = 1, threads = 1;
  Progress done;
  Campaign* campaign = nullptr;  ///< Where runs come from that are not all made here.

  /// The record of each, in the order of their seeds.
  template <typename One>
  auto records(const ScenarioSettings& scenario, const One& one) const {
    const auto seeded = [&](int k) {
      ScenarioSettings of_run = scenario;
      of_run.seed = first_seed + k;
      return one(of_run);
    };
    return recordsOf(
        campaign, count, threads, [&](int k) { return "seed " + std::to_string(first_seed + k); }, seeded, done);
  }
};

/// What closed-loop runs are made of. An experiment puts its own task in.
struct LoopParts {
  const VesselTree& tree;
  const CArmCalibration& nominal;
  ScenarioSettings scenario;
  ServoLoopSettings loop;
  SimulatedPatientSettings patient;
};

/// Many closed-loop simulations of the task `view`, each from another start to another view: a summary of true errors,
/// settling times and limits, and a row for each run.
Json viewExperiment(const LoopParts& parts, const Runs& runs);

/// The same as a table for people.
std::string viewExperimentTable(const Json& summary);

/// Many closed-loop simulations of the task `centre`, each of another point of the tree in another patient who
/// breathes, seen from another side; and each once more by the same task without prediction.
struct CenterExperimentSettings {
  double breathing_mm = 15;
  double heartbeat_mm = 2;
  double learn_s = 12;  ///< Errors count from then on: two breaths, and some.

  void visit(SettingsVisitor& v) {
    v.number("breathing_mm", breathing_mm, 0, 60,
             "Motion of the target by breathing: what is nearer to the feet moves less, so that the tree deforms");
    v.number("heartbeat_mm", heartbeat_mm, 0, 20, "Motion of the target in systole");
    v.fixed("learn_s", learn_s, 0, 3600);
  }
};
Json centerExperiment(const LoopParts& parts, const CenterExperimentSettings& experiment,
                      const CenterTaskSettings& center, const Runs& runs);
std::string centerExperimentTable(const Json& summary);

}  // namespace angio::experiments

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/experiments/seeds.hpp"
#include "servo_settings.hpp"

namespace angio::apps {

/// What the chosen sub-command does; returns the exit code.
using Work = std::function<int()>;

/// What all studies ask for.
struct ExperimentOptions {
  std::string tree, calibration, settings, out;
  int runs = 100, first_seed = 1, threads = 1;

  /// Adds them to a sub-command; calibration error, latency and duration come from `settings`.
  void add(CLI::App& command);

  VesselTree readTree() const;
  CArmCalibration readCalibration() const;

  /// The settings file; without one, the studies' own calibration error of 1 deg and 3 mm.
  ServoSettings readSettings() const;

  /// One row a run, in the order of their seeds. `one` makes it of a closed-loop simulation with its seed; `what` they
  /// do is shown while they do it.
  template <typename Row, typename One>
  std::vector<Row> runSeeds(const char* what, const ScenarioSettings& scenario, const One& one) const {
    std::vector<Row> rows(static_cast<std::size_t>(runs));
    ProgressBar bar(what, runs);
    forEachInParallel(
        runs, threads,
        [&](int k) {
          ScenarioSettings seeded = scenario;
          seeded.seed = first_seed + k;
          rows[static_cast<std::size_t>(k)] = one(seeded);
        },
        [&](int done) { bar.show(done); });
    return rows;
  }

  /// Prints a table, and writes the whole as JSON when --out was given.
  void write(nlohmann::ordered_json json, const std::string& table, const ServoSettings& settings) const;
};

/// Each adds its sub-command, which sets `work` when it is chosen.
void addSimulateView(CLI::App& app, Work& work);
void addSimulateNavigate(CLI::App& app, Work& work);
void addSimulateFaults(CLI::App& app, Work& work);
void addSimulateCenter(CLI::App& app, Work& work);

}  // namespace angio::apps

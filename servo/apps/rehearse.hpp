// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "angio/cli/progress_bar.hpp"
#include "angio/rehearsal/seeds.hpp"
#include "servo_settings.hpp"

namespace angio {

/// What the chosen sub-command does; returns the exit code.
using Work = std::function<int()>;

/// What all studies ask for.
struct StudyOptions {
  std::string tree, calibration, settings, out;
  int runs = 100, first_seed = 1, threads = 1;

  /// Adds them to a sub-command; calibration error, latency and duration come from `settings`.
  void add(CLI::App& command);

  VesselTree readTree() const;
  CArmCalibration readCalibration() const;

  /// The settings file; without one, the studies' own calibration error of 1 deg and 3 mm.
  ServoSettings readSettings() const;

  /// One row a run, in the order of their seeds. `one` makes it of a rehearsal with its seed; `what` they do is shown
  /// while they do it.
  template <typename Row, typename One>
  std::vector<Row> runSeeds(const char* what, const RehearsalSettings& rehearsal, const One& one) const {
    std::vector<Row> rows(static_cast<std::size_t>(runs));
    ProgressBar bar(what, runs);
    forEachInParallel(
        runs, threads,
        [&](int k) {
          RehearsalSettings seeded = rehearsal;
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
void addRehearseView(CLI::App& app, Work& work);
void addRehearseNavigate(CLI::App& app, Work& work);
void addRehearseFaults(CLI::App& app, Work& work);
void addRehearseCentre(CLI::App& app, Work& work);

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/evaluation/simulation_run.hpp"

namespace angio::evaluation {

/// One quantity of the simulation over its range, everything else as it was.
struct Sweep {
  struct Point {
    double value = 0;   ///< On the plot's axis.
    std::string label;  ///< For people: "2 deg, 5 mm".
    SimulationSettings settings;
  };
  std::string name, axis;  ///< "noise", "noise of each coordinate [px]".
  std::vector<Point> points;
};

/// The names there are: visible-fraction, noise, spurious, missing, start, focal, calibration, deformation.
std::vector<std::string> sweepNames();

/// The sweep of that name about `base`; `all` of them for "all". A sweep of the calibration needs two views and takes
/// them. Throws InputError that lists the names there are.
std::vector<Sweep> sweepsNamed(const std::string& name, const SimulationSettings& base);

/// A sweep that has been run: summaries by method, point by point.
struct SweepResult {
  Sweep sweep;
  std::vector<nlohmann::ordered_json> summaries;
};

SweepResult runSweep(const SimulationSetup& setup, const Sweep& sweep, const CaseProgress& progress = {});

nlohmann::ordered_json sweepAsJson(const SweepResult& result);

/// For people, Markdown.
std::string sweepTable(const SweepResult& result);

}  // namespace angio::evaluation

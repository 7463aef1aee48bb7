// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/calibration/calibration_simulation.hpp"
#include "angio/campaign/program.hpp"
#include "angio/cli/data_folder.hpp"

namespace angio::apps {

/// Calibrations of simulated machines against the truth: which, and where results go.
struct SimulatedStudy {
  std::string study;  ///< camera, geometry, timing; empty: none, and `out` is a folder of data.
  std::string out, settings;
  std::string nominal = exampleDataFile("hepatic-tace/carm.yaml");  ///< The C-arm that is drawn around.
  int trials = 200;
  CampaignOptions campaign;
};

/// Throws InputError where parts of the runs are asked for of what has none: data are written at once, and times are
/// this machine's.
void requireTrials(const SimulatedStudy& study);

/// Prints a study's tables, and writes its results or a shard's rows where asked. Returns the exit code.
int runStudy(const SimulatedStudy& study, const CalibrationSimulationSettings& settings, const Campaigns& campaigns);

}  // namespace angio::apps

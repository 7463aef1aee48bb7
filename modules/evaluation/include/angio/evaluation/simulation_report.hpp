// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "angio/evaluation/report_html.hpp"
#include "angio/evaluation/simulation_run.hpp"

namespace angio::evaluation {

/// What a report on one simulation shows.
struct SimulationReport {
  const SimulationSetup& setup;
  const SimulationSettings& settings;
  const std::vector<EntrantRun>& runs;
  const Json& summaries;  ///< Of the runs, by method.
  const std::vector<Json>& sweeps;
  Json settings_shown;  ///< All effective settings, by section.
  std::vector<std::string> tree_names;
  Json machine;  ///< Null: the report has neither times nor the machine.
};

/// One self-contained HTML page: figures of merit, success over start, errors, times, sweeps, the best, median and
/// worst trial as pictures, settings and machine.
std::string simulationReportHtml(const SimulationReport& report);

/// The curves of several runs, for other reports as well.
namespace html {

std::string captureFigure(const std::vector<EntrantRun>& runs);
std::string errorFigure(const std::vector<EntrantRun>& runs);
std::string startAndEndFigure(const std::vector<EntrantRun>& runs);
std::string timeFigure(const std::vector<EntrantRun>& runs);
std::string sweepFigure(const Json& swept);

/// Processor, cores and compiler as one line; empty for null.
std::string machineLine(const Json& machine);

/// The last section of a report: all effective settings, by section, and the machine unless it is null.
std::string settingsSection(const Json& settings_shown, const Json& machine);

}  // namespace html
}  // namespace angio::evaluation

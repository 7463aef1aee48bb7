// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "angio/evaluation/simulation_run.hpp"
#include "program_settings.hpp"

namespace angio::apps {

// Each adds its sub-command to the program, and becomes its work when the command line chooses it.
void addEvaluateSimulation(cli::Command& app, Work& work);
void addEvaluatePaper(cli::Command& app, Work& work);
void addEvaluateExtraction(cli::Command& app, Work& work);
void addEvaluateCatheter(cli::Command& app, Work& work);

/// What all of them ask of methods.
struct MethodOptions {
  std::vector<std::string> methods = {OrientedKernelSettings::kName};
  std::string extractor;  ///< Empty: the settings' choice.
  std::string settings;
  int starts = 0;
  bool nonrigid = false;

  /// @param as_yaml  For --print-settings: what is in force with a settings file.
  void addTo(cli::Command& command, const std::function<std::string(const std::string& path)>& as_yaml);

  /// Each method with its settings. Throws InputError for a name that is not there or is there twice.
  std::vector<Entrant> entrants(const ProgramSettings& of_file) const;
};

/// The option --model-axes; `axes` is its default.
cli::Option* addModelAxes(cli::Command& command, ModelAxes& axes);

/// Ends a sub-command: writes the results with the machine where `out` names a file, and prints the text. Returns 0.
int reported(Json json, const std::string& out, const std::string& text);

/// One run as other programs read it: {"methods": {M: {"cases": ..., "summary": ...}}}. Without displacements, which
/// have no place without their trees.
Json runsAsJson(const std::vector<EntrantRun>& runs, const Json& summaries);

/// The entrants' effective settings by their names.
Json entrantsAsJson(const std::vector<Entrant>& entrants);

}  // namespace angio::apps

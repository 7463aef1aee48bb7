// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/campaign/program.hpp"
#include "angio/cli/command_line_fwd.hpp"
#include "evaluate_results.hpp"

namespace angio::apps {

// Each adds its sub-command to the program, and becomes its work when the command line chooses it.
void addEvaluateSimulation(cli::Command& app, Work& work, const Campaigns& campaigns);
void addEvaluatePaper(cli::Command& app, Work& work, const Campaigns& campaigns);
void addEvaluateExtraction(cli::Command& app, Work& work, const Campaigns& campaigns);
void addEvaluateCatheter(cli::Command& app, Work& work, const Campaigns& campaigns);
void addEvaluateCatheterRuns(cli::Command& app, Work& work, const Campaigns& campaigns);

/// What all of them ask of methods.
struct MethodOptions : EntrantsAsked {
  std::string extractor;  ///< Empty: the settings' choice.
  std::string settings;

  /// @param as_yaml  For --print-settings: what is in force with a settings file.
  void addTo(cli::Command& command, const std::function<std::string(const std::string& path)>& as_yaml);

  /// entrantsOf(), which warns on stderr.
  std::vector<Entrant> entrants(const ProgramSettings& of_file) const;
};

/// The option --model-axes; `axes` is its default.
cli::Option* addModelAxes(cli::Command& command, ModelAxes& axes);

/// Adds the fingerprints of all that a case set names, and of its cameras and poses.
void addInputs(std::map<std::string, std::string>& inputs, const std::string& path, const CaseSet& set);

/// Ends a sub-command: writes the results with the machine, unless it is null, where `out` names a file, and prints
/// the text. Returns 0.
int reported(Json json, const std::string& out, const std::string& text, const Json& machine);

}  // namespace angio::apps

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/evaluation/simulation_run.hpp"
#include "program_settings.hpp"

namespace angio::apps {

/// Which methods take part, and how.
struct EntrantsAsked {
  std::vector<std::string> methods = {OrientedKernelSettings::kName};
  int starts = 0;  ///< 0: the settings' count, or the preset's own.
  bool nonrigid = false;
};

/// Each method with its settings. A method that is rigid takes part as it is where nonrigid ones are asked for, and
/// `warnings` get a line. Throws InputError for a name that is not there or is there twice.
std::vector<Entrant> entrantsOf(const EntrantsAsked& asked, const ProgramSettings& settings, std::ostream& warnings);

/// One run as other programs read it: {"methods": {M: {"cases": ..., "summary": ...}}}. Without displacements, which
/// have no place without their trees.
Json runsAsJson(const std::vector<EntrantRun>& runs, const Json& summaries);

/// The entrants' effective settings by their names.
Json entrantsAsJson(const std::vector<Entrant>& entrants);

/// How the cases of a set are run: CaseRunSettings without the method.
struct CasesAsked {
  std::vector<Entrant> entrants;
  ExtractorSettings extractor;
  PatientTrackerSettings tracker = trackerOfCases();
  bool point_covariance = false, nonrigid = false;
  Campaign* campaign = nullptr;  ///< As CaseRunSettings has it.
};

/// Called with how many registrations are done, and whose the last one was.
using EntrantProgress = std::function<void(int done, const std::string& entrant)>;

/// Runs every case with every entrant: {"methods": {M: {"cases": ..., "summary": ...}}, "settings": ...}. After an
/// interruption what is finished.
Json casesResults(const CaseSet& set, const CasesAsked& asked, const EntrantProgress& progress = {});

/// The summaries of such results by method.
Json summariesOf(const Json& results);

/// A simulation's results: runsAsJson() with the settings.
Json simulationResults(const SimulationSetup& setup, const SimulationSettings& settings,
                       const std::vector<EntrantRun>& runs, const Json& summaries);

}  // namespace angio::apps

// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluate_results.hpp"

#include <nlohmann/json.hpp>
#include <ostream>

#include "angio/base/errors.hpp"

namespace angio::apps {

std::vector<Entrant> entrantsOf(const EntrantsAsked& asked, const ProgramSettings& settings, std::ostream& warnings) {
  std::vector<Entrant> result;
  for (const auto& name : asked.methods) {
    for (const auto& other : result) {
      if (other.name == name) throw InputError("", "method", name, "must be named once");
    }
    Entrant entrant{name, settings.of(name, std::nullopt), settings.starts};
    if (asked.nonrigid && !setDeformation(entrant.registration, Deformation::kNonrigid)) {
      warnings << "angio-evaluate: " << name << " is rigid: it takes part without deformation\n";
    }
    if (const int own = startsOfPreset(name); own > 0) entrant.starts.count = own;
    if (asked.starts > 0) entrant.starts.count = asked.starts;
    result.push_back(entrant);
  }
  return result;
}

Json entrantsAsJson(const std::vector<Entrant>& entrants) {
  Json json;
  for (const auto& entrant : entrants) {
    json[entrant.name] = methodAsJson(entrant.registration)[methodName(entrant.registration)];
    if (entrant.starts.count != entrants.front().starts.count) json[entrant.name]["starts"] = entrant.starts.count;
  }
  if (!entrants.empty()) json["starts"] = settingsAsJson(entrants.front().starts);
  return json;
}

Json casesResults(const CaseSet& set, const CasesAsked& asked, const EntrantProgress& progress) {
  Json json, methods;
  int done = 0;
  for (const auto& entrant : asked.entrants) {
    const CaseRunSettings settings{entrant.registration,   entrant.starts, asked.extractor, asked.tracker,
                                   asked.point_covariance, asked.nonrigid, asked.campaign};
    const bool goes_on = finishPart(!methods.empty(), [&] {
      const auto outcomes = runCases(set, settings, [&](int) {
        ++done;
        if (progress) progress(done, entrant.name);
      });
      auto& entry = methods[entrant.name];
      for (const auto& outcome : outcomes) entry["cases"][outcome.name] = caseAsJson(outcome);
      entry["summary"] = summaryOf(outcomes);
    });
    if (!goes_on) break;
  }
  json["methods"] = methods;
  json["settings"] = entrantsAsJson(asked.entrants);
  json["settings"].update(extractorAsJson(asked.extractor));
  return json;
}

Json summariesOf(const Json& results) {
  Json summaries;
  for (const auto& [name, entry] : results["methods"].items()) summaries[name] = entry["summary"];
  return summaries;
}

Json runsAsJson(const std::vector<EntrantRun>& runs, const Json& summaries) {
  Json json;
  for (const auto& run : runs) {
    auto& entry = json["methods"][run.name];
    for (const auto& outcome : run.outcomes) {
      auto one = caseAsJson(outcome);
      one.erase("displacements_mm");
      entry["cases"][outcome.name] = one;
    }
    entry["summary"] = summaries[run.name];
  }
  return json;
}

Json simulationResults(const SimulationSetup& setup, const SimulationSettings& settings,
                       const std::vector<EntrantRun>& runs, const Json& summaries) {
  Json json = runsAsJson(runs, summaries);
  json["settings"] = entrantsAsJson(setup.entrants);
  if (settings.from == TrialSource::kImages) json["settings"].update(extractorAsJson(setup.extractor));
  json["settings"]["simulation"] = settingsAsJson(settings);
  return json;
}

}  // namespace angio::apps

// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate cases: every case of a case set.
#include <iostream>
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/whole_file.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

struct CasesOptions {
  MethodOptions method;
  std::string cases, out;
};

int evaluateCases(const CasesOptions& o) {
  requireFolderOf(o.out);
  ProgramSettings settings;
  if (!o.method.settings.empty()) settings = readSettings(o.method.settings, settings);
  const std::vector<Entrant> entrants = o.method.entrants(settings);
  const ExtractorSettings extractor = chosenExtractor(settings, o.method.extractor);
  const CaseSet set = readCaseSet(o.cases);

  nlohmann::ordered_json json, summaries;
  ProgressBar bar("registering", static_cast<int>(set.cases.size() * entrants.size()));
  int done_before = 0;
  for (const auto& entrant : entrants) {
    const auto outcomes = runCases(set, {entrant.registration, entrant.starts, extractor, settings.tracker},
                                   [&](int done) { bar.show(done_before + done, entrant.name); });
    done_before += static_cast<int>(outcomes.size());
    auto& entry = json["methods"][entrant.name];
    for (const auto& outcome : outcomes) entry["cases"][outcome.name] = caseAsJson(outcome);
    entry["summary"] = summaries[entrant.name] = summaryOf(outcomes);
  }
  json["settings"] = entrantsAsJson(entrants);
  json["settings"].update(extractorAsJson(extractor));
  json["machine"] = machineAsJson();
  if (!o.out.empty()) writeWholeFile(o.out, json.dump(1) + "\n");
  std::cout << summaryTable(summaries);
  return 0;
}

}  // namespace

void addEvaluateCases(CLI::App& app, Work& work) {
  const auto o = std::make_shared<CasesOptions>();
  auto* command = app.add_subcommand("cases", "Run every case of a case set");
  command->option_defaults()->always_capture_default();
  command->add_option("cases", o->cases, "Case set (cases.yaml)")->required();
  o->method.addTo(*command);
  command->add_flag("--nonrigid", o->method.nonrigid, "Let the tree deform after the rigid registration");
  command->add_option("--out", o->out, "All results (.json)");
  command->callback([o, &work] { work = [o] { return evaluateCases(*o); }; });
}

}  // namespace angio::apps

// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate: many registrations, and what they amount to.
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/experiment.hpp"
#include "evaluate.hpp"

namespace angio::apps {

void MethodOptions::addTo(cli::Command& command, const std::function<std::string(const std::string& path)>& as_yaml) {
  command
      .addOption("--method", methods, "Methods, separated by commas; iterative_pnp:paper, :huber and :best are presets")
      ->delimiter(',');
  command.addOption("--starts", starts, "Starts drawn around the initial pose; 0 takes the settings' count")
      ->check(cli::wholeBetween(0, 10000));
  command.addOption("--extractor", extractor,
                    "Centrelines of images: " + listOfExtractors() + "; the settings' choice when not given");
  addSettingsOptions(command, settings, "Settings (.yaml), sections by method, starts, extractors", as_yaml);
}

std::vector<Entrant> MethodOptions::entrants(const ProgramSettings& of_file) const {
  std::vector<Entrant> result;
  for (const auto& name : methods) {
    for (const auto& other : result) {
      if (other.name == name) throw InputError("", "method", name, "must be named once");
    }
    Entrant entrant{name, of_file.of(name, std::nullopt), of_file.starts};
    if (nonrigid && !setDeformation(entrant.registration, Deformation::kNonrigid)) {
      std::cerr << "angio-evaluate: " << name << " is rigid: it takes part without deformation\n";
    }
    if (const int own = startsOfPreset(name); own > 0) entrant.starts.count = own;
    if (starts > 0) entrant.starts.count = starts;
    result.push_back(entrant);
  }
  return result;
}

cli::Option* addModelAxes(cli::Command& command, ModelAxes& axes) {
  const std::map<std::string, ModelAxes> names = {
      {"lps", ModelAxes::kLps}, {"ras", ModelAxes::kRas}, {"lip", ModelAxes::kLip}};
  std::string standard;
  for (const auto& [name, value] : names) {
    if (value == axes) standard = name;
  }
  return command
      .addOption("--model-axes", axes, "Where the tree's x, y, z point in the patient; lip: left, inferior, posterior")
      ->check(choice(names))
      ->defaultText(standard);
}

int reported(Json json, const std::string& out, const std::string& text) {
  json["machine"] = machineAsJson();
  if (!out.empty()) writeWholeFile(out, json.dump(1) + "\n");
  std::cout << text;
  return 0;
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

Json entrantsAsJson(const std::vector<Entrant>& entrants) {
  Json json;
  for (const auto& entrant : entrants) {
    json[entrant.name] = methodAsJson(entrant.registration)[methodName(entrant.registration)];
    if (entrant.starts.count != entrants.front().starts.count) json[entrant.name]["starts"] = entrant.starts.count;
  }
  if (!entrants.empty()) json["starts"] = settingsAsJson(entrants.front().starts);
  return json;
}

namespace {

struct CasesOptions {
  MethodOptions method;
  std::string cases, out;
  bool point_covariance = false;
};

int evaluateCases(const CasesOptions& o) {
  requireFolderOf(o.out);
  ProgramSettings settings;
  if (!o.method.settings.empty()) settings = readSettings(o.method.settings, settings);
  const std::vector<Entrant> entrants = o.method.entrants(settings);
  const ExtractorSettings extractor = chosenExtractor(settings, o.method.extractor);
  const CaseSet set = readCaseSet(o.cases);

  Json json, summaries;
  ProgressBar bar("registering", static_cast<int>(set.cases.size() * entrants.size()));
  int done = 0;
  for (const auto& entrant : entrants) {
    const bool goes_on = finishPart(!summaries.empty(), [&] {
      const auto outcomes = runCases(
          set,
          {entrant.registration, entrant.starts, extractor, settings.tracker, o.point_covariance, o.method.nonrigid},
          [&](int) { bar.show(++done, entrant.name); });
      auto& entry = json["methods"][entrant.name];
      for (const auto& outcome : outcomes) entry["cases"][outcome.name] = caseAsJson(outcome);
      entry["summary"] = summaries[entrant.name] = summaryOf(outcomes);
    });
    if (!goes_on) break;
  }
  json["settings"] = entrantsAsJson(entrants);
  json["settings"].update(extractorAsJson(extractor));
  return reported(json, o.out, summaryTable(summaries));
}

void addEvaluateCases(cli::Command& app, Work& work) {
  const auto o = std::make_shared<CasesOptions>();
  auto* command = app.addSubcommand("cases", "Run every case of a case set");
  command->addOption("cases", o->cases, "Case set (cases.yaml)")->required();
  o->method.addTo(*command, settingsInForce<ProgramSettings>);
  command->addFlag("--nonrigid", o->method.nonrigid, "Let the tree deform after the rigid registration");
  command->addFlag("--point-covariance", o->point_covariance,
                   "Add the covariance of each point of the tree to each result [mm^2]");
  command->addOption("--out", o->out, "All results (.json)");
  command->onChosen([o, &work] { work = [o] { return evaluateCases(*o); }; });
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  angio::cli::Command app("Runs registrations over many cases and reports what they amount to.", "angio-evaluate");
  angio::apps::describeProgram(
      app,
      "angio-evaluate cases cases.yaml --method iterative_pnp,oriented_kernel --out results.json\n"
      "  angio-evaluate simulation --tree tree.csv --trials 200 --report report.html\n"
      "  angio-evaluate paper --report paper.html\n"
      "  angio-evaluate extraction --tree tree.csv --extractor ridge,otsu --sheet sheet.png\n"
      "  angio-evaluate catheter examples/data/hepatic-tace/cases.yaml --sheet sheet.png");
  app.requireSubcommand();
  angio::apps::Work work;
  angio::apps::addEvaluateCases(app, work);
  angio::apps::addEvaluateSimulation(app, work);
  angio::apps::addEvaluatePaper(app, work);
  angio::apps::addEvaluateExtraction(app, work);
  angio::apps::addEvaluateCatheter(app, work);
  return angio::apps::runProgram(app, argc, argv, [&] { return work(); });
}

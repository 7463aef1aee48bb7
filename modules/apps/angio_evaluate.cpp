// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate: many registrations, and what they amount to.
#include <iostream>

#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/case_run.hpp"
#include "angio/io/whole_file.hpp"
#include "program_settings.hpp"

namespace angio {
namespace {

struct CasesOptions {
  std::string cases, settings, out;
  std::vector<std::string> methods = {IterativePnpSettings::kName};
  int starts = 0;
  bool nonrigid = false;
};

int evaluateCases(const CasesOptions& o) {
  ProgramSettings settings;
  if (!o.settings.empty()) settings = readSettings(o.settings, settings);
  if (o.starts > 0) settings.starts.count = o.starts;
  std::vector<RegistrationSettings> methods;
  for (const auto& name : o.methods) {
    methods.push_back(settings.of(name, o.nonrigid ? std::optional(Deformation::kNonrigid) : std::nullopt));
  }
  const CaseSet set = readCaseSet(o.cases);

  nlohmann::ordered_json json, summaries;
  ProgressBar bar("registering", static_cast<int>(set.cases.size() * methods.size()));
  int done_before = 0;
  for (const auto& method : methods) {
    const std::string name = methodName(method);
    const auto outcomes = runCases(set, {method, settings.starts, settings.otsu},
                                   [&](int done) { bar.show(done_before + done, name); });
    done_before += static_cast<int>(outcomes.size());
    auto& entry = json["methods"][name];
    for (const auto& outcome : outcomes) entry["cases"][outcome.name] = caseAsJson(outcome);
    entry["summary"] = summaries[name] = summaryOf(outcomes);
    json["settings"].update(methodAsJson(method));
  }
  json["settings"]["starts"] = settingsAsJson(settings.starts);
  json["settings"][OtsuSettings::kName] = settingsAsJson(settings.otsu);
  json["machine"] = machineAsJson();
  if (!o.out.empty()) writeWholeFile(o.out, json.dump(1) + "\n");
  std::cout << summaryTable(summaries);
  return 0;
}

}  // namespace
}  // namespace angio

int main(int argc, char** argv) {
  CLI::App app("Runs registrations over many cases and reports what they amount to.", "angio-evaluate");
  angio::describeProgram(app, "angio-evaluate cases cases.yaml --method iterative_pnp --out results.json");
  app.require_subcommand(1);
  angio::CasesOptions o;
  auto* cases = app.add_subcommand("cases", "Run every case of a case set");
  cases->option_defaults()->always_capture_default();
  cases->add_option("cases", o.cases, "Case set (cases.yaml)")->required();
  cases->add_option("--method", o.methods, "Methods, separated by commas")->delimiter(',');
  cases->add_flag("--nonrigid", o.nonrigid, "Let the tree deform after the rigid registration");
  cases->add_option("--starts", o.starts, "Starts drawn around the initial pose; 0 takes the settings' count")
      ->check(CLI::Range(0, 10000));
  cases->add_option("--settings", o.settings, "Settings (.yaml), sections by method, starts, otsu");
  cases->add_option("--out", o.out, "All results (.json)");
  return angio::runProgram(app, argc, argv, [&] { return angio::evaluateCases(o); });
}

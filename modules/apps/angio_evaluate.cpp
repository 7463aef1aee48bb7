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
#include "angio/results/record_row.hpp"
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
  return entrantsOf(*this, of_file, std::cerr);
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

int reported(Json json, const std::string& out, const std::string& text, const Json& machine) {
  if (!machine.is_null()) json["machine"] = machine;
  if (!out.empty()) writeWholeFile(out, json.dump(1) + "\n");
  std::cout << text;
  return 0;
}

void addInputs(std::map<std::string, std::string>& inputs, const std::string& path, const CaseSet& set) {
  addInput(inputs, path);
  Json places = Json::array();
  for (const Case& one : set.cases) {
    addInput(inputs, one.tree_path);
    addInput(inputs, one.truth_displacements_path.value_or(""));
    places.push_back({toRow(one.initial_pose), toRow(one.truth_pose)});
    for (const View& view : one.views) {
      addInput(inputs, view.centerline_path.value_or(""));
      addInput(inputs, view.image_path.value_or(""));
      const XrayCamera::Parameters& p = view.camera.parameters();
      places.push_back({p.width_px, p.height_px, p.fx_px, p.fy_px, p.cx_px, p.cy_px, toRow(p.pixel_spacing_m),
                        toRow(p.source_detector_distance_m), toRow(view.T_view_first)});
      for (const auto& corner : view.collimator_px) places.push_back(toRow(corner));
    }
  }
  inputs["cameras and poses of " + path] = campaign::fingerprintOf(places.dump());
}

namespace {

struct CasesOptions {
  MethodOptions method;
  CampaignOptions campaign;
  std::string cases, out;
  bool point_covariance = false;
};

int evaluateCases(const CasesOptions& o, const CaseSet& set, CasesAsked asked, const CampaignRun& run) {
  asked.campaign = run.rows;
  ProgressBar bar("registering", run.share(static_cast<int>(set.cases.size() * asked.entrants.size())));
  const Json json =
      run.shown(casesResults(set, asked, [&](int done, const std::string& entrant) { bar.show(done, entrant); }));
  if (!run.done()) return 0;
  return reported(json, o.out, summaryTable(summariesOf(json)), run.machine);
}

int evaluateCases(const CasesOptions& o, const Campaigns& campaigns) {
  requireFolderOf(o.out);
  ProgramSettings settings;
  if (!o.method.settings.empty()) settings = readSettings(o.method.settings, settings);
  const CasesAsked asked{o.method.entrants(settings), chosenExtractor(settings, o.method.extractor), settings.tracker,
                         o.point_covariance, o.method.nonrigid};
  const CaseSet set = readCaseSet(o.cases);
  CampaignJob job{o.campaign, o.out, static_cast<int>(set.cases.size()), {}, [&](const CampaignRun& run) {
                    return evaluateCases(o, set, asked, run);
                  }};
  addInput(job.inputs, o.method.settings);
  addInputs(job.inputs, o.cases, set);
  return campaigns.run(job);
}

void addEvaluateCases(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<CasesOptions>();
  auto* command = app.addSubcommand("cases", "Run every case of a case set");
  command->addOption("cases", o->cases, "Case set (cases.yaml)")->required();
  o->method.addTo(*command, settingsInForce<ProgramSettings>);
  command->addFlag("--nonrigid", o->method.nonrigid, "Let the tree deform after the rigid registration");
  command->addFlag("--point-covariance", o->point_covariance,
                   "Add the covariance of each point of the tree to each result [mm^2]");
  command->addOption("--out", o->out, "All results (.json)");
  o->campaign.addTo(*command);
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluateCases(*o, campaigns); }; });
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  using namespace angio;
  campaign::CampaignProgram program{
      "angio-evaluate",
      "Runs registrations over many cases and reports what they amount to.",
      "angio-evaluate cases cases.yaml --method iterative_pnp,oriented_kernel --out results.json\n"
      "  angio-evaluate simulation --tree tree.csv --trials 200 --report report.html\n"
      "  angio-evaluate paper --report paper.html\n"
      "  angio-evaluate extraction --tree tree.csv --extractor ridge,otsu --sheet sheet.png\n"
      "  angio-evaluate catheter examples/data/hepatic-tace/cases.yaml --sheet sheet.png",
      [](cli::Command& app, cli::Work& work, const campaign::Campaigns& campaigns) {
        apps::addEvaluateCases(app, work, campaigns);
        apps::addEvaluateSimulation(app, work, campaigns);
        apps::addEvaluatePaper(app, work, campaigns);
        apps::addEvaluateExtraction(app, work, campaigns);
        apps::addEvaluateCatheter(app, work, campaigns);
        apps::addEvaluateCatheterRuns(app, work, campaigns);
      },
      {},
      true};
  return campaign::runCampaignProgram(program, argc, argv);
}

// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate paper: the experiments of the Iterative PnP paper beside its printed figures.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/paper.hpp"
#include "angio/evaluation/paper_real.hpp"
#include "angio/evaluation/point_sets.hpp"
#include "angio/evaluation/simulation_report.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/experiment.hpp"
#include "angio/vessel/resample.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

// As many points as the paper's trees have, about two thousand for the bundled one.
constexpr double kTreeSpacing_m = 1e-3;
constexpr int kMaxTreePoints = 15000;

// Of Table II: each of the phantom's runs from so many starts, spread as Table I's.
constexpr int kTrialsForStart = 4;

const std::string kLoss = "loss", kVisibleFraction = "visible-fraction", kPointSets = "3d-3d";

// The data that stand in for the paper's in Table II.
const std::string kPhantomCases = "static-phantom/cases.yaml", kCatheterCases = "hepatic-tace/cases.yaml";
const std::string kRealCases[] = {kPhantomCases, kCatheterCases};

struct PaperOptions {
  MethodOptions method;
  CampaignOptions campaign;
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), out, report;
  std::vector<int> tables;
  std::vector<std::string> figures;
  int trials = 100, seed = 1;
  ModelAxes model_axes = ModelAxes::kLip;  // The bundled tree's: y runs down the patient.

  bool asksFor(int table) const { return std::find(tables.begin(), tables.end(), table) != tables.end(); }
  bool asksFor(const std::string& figure) const {
    return std::find(figures.begin(), figures.end(), figure) != figures.end();
  }
};

// Rigid or nonrigid, whatever the settings say; of methods that are rigid no nonrigid one.
std::vector<Entrant> deformed(const std::vector<Entrant>& entrants, Deformation deformation) {
  std::vector<Entrant> result;
  for (Entrant entrant : entrants) {
    if (!setDeformation(entrant.registration, deformation)) continue;
    entrant.name += deformation == Deformation::kRigid ? ", rigid" : ", nonrigid";
    result.push_back(std::move(entrant));
  }
  return result;
}

// The experiments that are asked for, one after the other, and what they say.
class PaperExperiments {
 public:
  PaperExperiments(const PaperOptions& o, const CampaignRun& campaign)
      : o_(o),
        campaign_(campaign),
        file_(o.method.settings.empty() ? ProgramSettings() : readSettings(o.method.settings, ProgramSettings())) {
    setup_.campaign = campaign.rows;
    setup_.trees.push_back(resampled(readVesselTree(o.tree), kTreeSpacing_m, kMaxTreePoints).tree);
    const std::vector<Entrant> entrants = o.method.entrants(file_);
    rigid_ = deformed(entrants, Deformation::kRigid);
    both_ = rigid_;
    for (Entrant& entrant : deformed(entrants, Deformation::kNonrigid)) both_.push_back(std::move(entrant));
    const auto levels = static_cast<int>(paperStarts().size());
    total_ = static_cast<int>(both_.size()) * o.trials * (o.asksFor(3) ? levels : o.asksFor(1) ? 1 : 0);
    if (o.asksFor(kLoss)) total_ += static_cast<int>(byLoss().size()) * levels * o.trials;
    if (o.asksFor(kVisibleFraction)) {
      total_ += static_cast<int>(rigid_.size() * visibleFraction().points.size()) * o.trials;
    }
    if (o.asksFor(kPointSets)) total_ += pointSetStudySize(o.trials);
    if (o.asksFor(2)) real_ = realCases();
    for (const RealCases& cases : real_)
      total_ += static_cast<int>(cases.set.cases.size() * ableToRun(cases, both_).size());
  }

  int report() {
    bar_.emplace("registering", campaign_.share(total_));
    const bool goes_on = (!o_.asksFor(1) && !o_.asksFor(3)) || tables1And3();
    if (goes_on && o_.asksFor(2)) table2();
    if (!interrupted() && o_.asksFor(kLoss)) losses();
    if (!interrupted() && o_.asksFor(kVisibleFraction)) visible();
    if (!interrupted() && o_.asksFor(kPointSets)) {
      paper_["point_sets"] = pointSetStudy(
          setup_.trees.front(), o_.trials, o_.seed, [&](int) { bar_->show(++done_); }, campaign_.rows);
    }
    if (!campaign_.done()) return 0;
    paper_ = campaign_.shown(std::move(paper_));

    Json json;
    if (!table1_.empty()) {
      json = runsAsJson(table1_, simulationSummaries(table1_, simulatedCamera().parameters().pixel_spacing_m));
    }
    json = campaign_.shown(std::move(json));
    json["paper"] = paper_;
    json["settings"] = entrantsAsJson(both_);
    json["settings"]["simulation"] = settingsAsJson(protocol(paperTable1Start()));
    json["settings"]["simulation"]["tree"] = std::filesystem::path(o_.tree).filename().string();
    if (!o_.report.empty()) {
      writeWholeFile(o_.report, paperReportHtml({table1_, paper_, json["settings"]["simulation"]["tree"],
                                                 json["settings"], campaign_.machine}));
    }
    return reported(json, o_.out, tables(), campaign_.machine);
  }

 private:
  SimulationSettings protocol(const PaperStart& start) const {
    SimulationSettings settings = paperProtocol(start, o_.trials, o_.seed);
    settings.model_axes = o_.model_axes;
    return settings;
  }

  std::vector<EntrantRun> run(const std::vector<Entrant>& entrants, const PaperStart& start) {
    setup_.entrants = entrants;
    return runSimulation(setup_, protocol(start), [&](int) { bar_->show(++done_); });
  }

  std::vector<PaperLevel> overStarts(const std::vector<Entrant>& entrants) {
    std::vector<PaperLevel> levels;
    for (const auto& start : paperStarts()) {
      const bool known = &start == &paperTable1Start() && &entrants == &both_;  // Table I is this row.
      if (!finishPart(true, [&] { levels.push_back({start, known ? table1_ : run(entrants, start)}); })) break;
    }
    return levels;
  }

  // Returns whether the rest is wanted still.
  bool tables1And3() {
    table1_ = run(both_, paperTable1Start());
    std::vector<PaperLevel> table3;
    if (o_.asksFor(3) && !interrupted()) table3 = overStarts(both_);
    paper_ = paperAsJson(table1_, table3);
    return !interrupted();
  }

  std::vector<RealCases> realCases() const {
    const CaseSet phantom =
        withDrawnStarts(readCaseSet(exampleDataFile(kPhantomCases)), paperTable1Start().rotation_std_deg,
                        paperTable1Start().translation_std_mm, std::max(1, o_.trials / kTrialsForStart), o_.seed);
    return {{"static phantom, its centrelines", phantom, true},
            {"static phantom, by the extractor", seenByImages(phantom), true},
            {"clinical catheter run", readCaseSet(exampleDataFile(kCatheterCases)), false}};
  }
  void table2() {
    const ExtractorSettings extractor = chosenExtractor(file_, o_.method.extractor);
    std::vector<RealRuns> all;
    for (const RealCases& cases : real_) {
      const bool goes_on = finishPart(true, [&] {
        all.push_back(runRealCases(
            cases, both_, extractor, [&](int) { bar_->show(++done_); }, campaign_.rows));
      });
      if (!goes_on) break;
    }
    paper_["table2"] = paperTable2AsJson(all);
  }

  std::vector<Entrant> byLoss() const {
    const std::string name = IterativePnpSettings::kName;
    MethodOptions options;
    options.methods = {name + ":paper", name + ":huber", name + ":l2"};
    return options.entrants(file_);
  }
  void losses() { paper_["losses"] = paperAsJson({}, overStarts(byLoss()))["table3"]; }

  Sweep visibleFraction() const { return sweepsNamed(kVisibleFraction, protocol(paperTable1Start())).front(); }
  void visible() {
    setup_.entrants = rigid_;
    paper_["visible_fraction"] = runSweep(setup_, visibleFraction(), [&](int) { bar_->show(++done_); });
  }

  std::string tables() const {
    std::string text;
    const auto add = [&](const char* part, const auto& table) {
      if (paper_.contains(part)) text += (text.empty() ? "" : "\n") + table(paper_);
    };
    if (o_.asksFor(1)) add("table1", paperTable1);
    add("table2", [](const Json& paper) { return paperTable2(paper["table2"]); });
    add("table3", paperTable3);
    add("losses", [](const Json& paper) { return lossTable(paper["losses"]); });
    add("visible_fraction", [](const Json& paper) { return sweepTable(paper["visible_fraction"]); });
    add("point_sets", [](const Json& paper) { return pointSetTable(paper["point_sets"]); });
    return text;
  }

  const PaperOptions& o_;
  const CampaignRun& campaign_;
  ProgramSettings file_;
  SimulationSetup setup_;
  std::vector<Entrant> rigid_, both_;
  std::vector<RealCases> real_;
  int total_ = 0, done_ = 0;
  std::optional<ProgressBar> bar_;
  std::vector<EntrantRun> table1_;
  Json paper_ = Json::object();
};

int evaluatePaper(PaperOptions o, const Campaigns& campaigns) {
  for (const auto& path : {o.out, o.report}) requireFolderOf(path);
  if (o.tables.empty() && o.figures.empty()) o.tables = {1, 3};
  CampaignJob job{
      o.campaign, o.out, o.trials, {}, [&](const CampaignRun& run) { return PaperExperiments(o, run).report(); }};
  for (const auto& path : {o.method.settings, o.tree}) addInput(job.inputs, path);
  if (o.asksFor(2)) {
    for (const std::string& name : kRealCases) {
      const std::string path = exampleDataFile(name);
      addInputs(job.inputs, path, readCaseSet(path));
    }
  }
  return campaigns.run(job);
}

}  // namespace

void addEvaluatePaper(cli::Command& app, Work& work, const Campaigns& campaigns) {
  const auto o = std::make_shared<PaperOptions>();
  const std::string papers = IterativePnpSettings::kName;
  o->method.methods = {AutoMaskSettings::kName,
                       PairwiseDnnSettings::kName,
                       RgrbSettings::kName,
                       DtIcpSettings::kName,
                       NicpSettings::kName,
                       CvoSettings::kName,
                       papers + ":paper",
                       papers + ":huber",
                       papers,
                       papers + ":best",
                       OrientedKernelSettings::kName};
  auto* command = app.addSubcommand("paper", "Repeat the experiments of the Iterative PnP paper");
  command->footer(
      "Example:\n  angio-evaluate paper --table 1 --table 3 --trials 100 --report paper.html\n\nThe paper's method "
      "stands as the paper has it (iterative_pnp:paper), with Huber's loss in place of its kernel "
      "(iterative_pnp:huber), by our defaults, and at the best settings found for it (iterative_pnp:best).");
  command->addOption("--tree", o->tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  addModelAxes(*command, o->model_axes);
  command
      ->addOption("--table", o->tables,
                  "Table I, II (on real images) or III; may be repeated; when not given I and III")
      ->check(cli::wholeBetween(1, 3))
      ->takeAll();
  command
      ->addOption(
          "--figure", o->figures,
          "What each loss leaves, here or from 3D to 3D, or what a part of the tree in view does; may be repeated")
      ->check(cli::oneOf({kLoss, kVisibleFraction, kPointSets}))
      ->takeAll();
  command
      ->addOption("--trials", o->trials,
                  "Trials of each row; in Table II a quarter of it, from each of the phantom's runs")
      ->check(cli::wholeBetween(1, 100000));
  command->addOption("--seed", o->seed, "Seed of all draws")->check(cli::wholeBetween(0, 2147483647));
  o->method.addTo(*command, settingsInForce<ProgramSettings>);
  command->addOption("--out", o->out, "All results (.json)");
  auto* report = command->addOption("--report", o->report, "Report with curves (.html)");
  o->campaign.addTo(*command, {report});
  command->onChosen([o, &work, &campaigns] { work = [o, &campaigns] { return evaluatePaper(*o, campaigns); }; });
}

}  // namespace angio::apps

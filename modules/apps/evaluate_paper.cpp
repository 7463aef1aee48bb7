// SPDX-License-Identifier: GPL-2.0-or-later
// angio-evaluate paper: the simulation experiments of the Iterative PnP paper beside its printed figures.
#include <filesystem>
#include <iostream>
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/evaluation/paper.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/vessel/resample.hpp"
#include "evaluate.hpp"

namespace angio::apps {
namespace {

// As many points as the paper's trees have, about two thousand for the bundled one.
constexpr double kTreeSpacing_m = 1e-3;
constexpr int kMaxTreePoints = 15000;

struct PaperOptions {
  MethodOptions method;
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), out, report;
  int trials = 100, seed = 1;
  ModelAxes model_axes = ModelAxes::kLip;  // The bundled tree's: y runs down the patient.
};

// Rigid or nonrigid, whatever the settings say.
std::vector<Entrant> deformed(std::vector<Entrant> entrants, Deformation deformation) {
  for (auto& entrant : entrants) {
    std::visit([&](auto& s) { s.deformation = deformation; }, entrant.registration);
    entrant.name += deformation == Deformation::kRigid ? ", rigid" : ", nonrigid";
  }
  return entrants;
}

std::vector<Entrant> entrantsOf(const PaperOptions& o) {
  ProgramSettings settings;
  if (!o.method.settings.empty()) settings = readSettings(o.method.settings, settings);
  std::vector<Entrant> entrants = o.method.entrants(settings);
  for (auto& entrant : entrants) {
    auto* of_paper = std::get_if<IterativePnpSettings>(&entrant.registration);
    if (!of_paper || !o.method.settings.empty()) continue;
    // The paper matches one point to one point; our default fills in between, which helps where they do not correspond.
    of_paper->neighbours_each_side = 0;
    of_paper->spacing_px = 0;
  }
  return entrants;
}

int evaluatePaper(const PaperOptions& o) {
  for (const auto& path : {o.out, o.report}) requireFolderOf(path);
  const std::vector<Entrant> entrants = entrantsOf(o);
  SimulationSetup setup;
  setup.trees.push_back(resampled(readVesselTree(o.tree), kTreeSpacing_m, kMaxTreePoints).tree);
  const auto rigid = deformed(entrants, Deformation::kRigid), nonrigid = deformed(entrants, Deformation::kNonrigid);
  std::vector<Entrant> both = rigid;
  both.insert(both.end(), nonrigid.begin(), nonrigid.end());
  const auto protocol = [&](const PaperStart& start) {
    SimulationSettings settings = paperProtocol(start, o.trials, o.seed);
    settings.model_axes = o.model_axes;
    return settings;
  };

  const std::size_t levels = paperStarts().size();
  ProgressBar bar("registering", o.trials * static_cast<int>(both.size() + rigid.size() * (levels - 1)));
  int done_before = 0;
  const auto run = [&](const std::vector<Entrant>& who, const PaperStart& start) {
    setup.entrants = who;
    auto runs = runSimulation(setup, protocol(start), [&](int done) { bar.show(done_before + done); });
    done_before += o.trials * static_cast<int>(who.size());
    return runs;
  };
  const auto table1 = run(both, paperTable1Start());
  std::vector<PaperLevel> table3;
  for (const auto& start : paperStarts()) {
    const bool known = &start == &paperTable1Start();  // The rigid half of Table I is this row.
    const auto half = table1.begin() + static_cast<std::ptrdiff_t>(rigid.size());
    table3.push_back({start, known ? std::vector<EntrantRun>(table1.begin(), half) : run(rigid, start)});
  }

  const auto spacing_m = simulatedCamera().parameters().pixel_spacing_m;
  auto json = runsAsJson(table1, simulationSummaries(table1, spacing_m));
  const Json paper = json["paper"] = paperAsJson(table1, table3);
  json["settings"] = entrantsAsJson(both);
  json["settings"]["simulation"] = settingsAsJson(protocol(paperTable1Start()));
  json["settings"]["simulation"]["tree"] = std::filesystem::path(o.tree).filename().string();
  json["machine"] = machineAsJson();
  if (!o.out.empty()) writeWholeFile(o.out, json.dump(1) + "\n");
  if (!o.report.empty()) {
    writeWholeFile(o.report, paperReportHtml(table1, paper, json["settings"]["simulation"]["tree"], json["settings"]));
  }
  std::cout << paperTable1(paper) << "\n" << paperTable3(paper);
  return 0;
}

}  // namespace

void addEvaluatePaper(CLI::App& app, Work& work) {
  const auto o = std::make_shared<PaperOptions>();
  auto* command = app.add_subcommand("paper", "Repeat the simulation experiments of the Iterative PnP paper");
  command->option_defaults()->always_capture_default();
  command->footer(
      "Example:\n  angio-evaluate paper --trials 100 --report paper.html\n\nWithout --settings, iterative_pnp "
      "matches one image point to one point of the tree, as the paper does.");
  command->add_option("--tree", o->tree, "Vessel tree (.csv, .swc, .vtp, HMM .txt)");
  addModelAxes(*command, o->model_axes);
  command->add_option("--trials", o->trials, "Trials of each row")->check(CLI::Range(1, 100000));
  command->add_option("--seed", o->seed, "Seed of all draws")->check(CLI::Range(0, 2147483647));
  o->method.addTo(*command);
  command->add_option("--out", o->out, "All results (.json)");
  command->add_option("--report", o->report, "Report with curves (.html)");
  command->callback([o, &work] { work = [o] { return evaluatePaper(*o); }; });
}

}  // namespace angio::apps

// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate-loop: many simulated runs of each task, images and registration in the loop, and what became of them.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/experiments/fault_experiment.hpp"
#include "angio/experiments/task_experiments.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/results/experiment.hpp"
#include "centered_option.hpp"
#include "patient_options.hpp"
#include "servo_settings.hpp"
#include "simulate_loop.hpp"

namespace angio::apps {
namespace {

// What the experiments ask for.
struct ExperimentOptions {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv"), calibration = exampleDataFile("hepatic-tace/carm.yaml");
  std::string t_dsa_cb, settings, out, machine = "both";
  PatientOptions patient;
  CampaignOptions campaign;
  Runs runs;
  CenterExperimentSettings center;
  double center_duration_s = 30;
};

// One experiment with its files read.
struct Experiment {
  const ExperimentOptions& options;
  ServoSettings settings;
  VesselTree tree;
  CArmCalibration nominal;
  Runs runs;
  const CampaignRun& campaign;

  LoopParts parts() const { return {tree, nominal, settings.scenario, settings.loop(nominal), settings.patient}; }

  // `table` makes text of what is reported; nothing is when a part of the runs is all there is.
  int report(Json json, std::string (*table)(const Json& json)) const {
    if (!campaign.done()) return 0;
    json = campaign.shown(std::move(json));
    const std::string text = table(json);
    if (!options.patient.deformation_field.empty()) json["deformation_field"] = options.patient.deformation_field;
    return apps::report(std::move(json), text, settingsAsJson(settings), campaign.machine, options.out);
  }
};

int simulateViews(const Experiment& e) { return e.report(viewExperiment(e.parts(), e.runs), viewExperimentTable); }

int keepCentered(Experiment& e) {
  e.settings.scenario.duration_s = e.options.center_duration_s;
  const auto& center = e.settings.tasks.of<CenterTaskSettings>();
  return e.report(centerExperiment(e.parts(), e.options.center, center, e.runs), centerExperimentTable);
}

int failSafely(const Experiment& e) {
  const std::string& machine = e.options.machine;
  FaultParts parts;
  parts.carm_loop = e.settings.loop(e.nominal);
  parts.patient = e.settings.patient;
  const auto rows = e.runs.records(e.settings.scenario, [&](const ScenarioSettings& seeded) {
    const bool both = machine == "both", catheter = both ? seeded.seed % 2 == 0 : machine == "catheter";
    const auto kind = static_cast<FaultKind>((both ? seeded.seed / 2 : seeded.seed) % kFaultKindCount);
    FaultParts of_run = parts;
    of_run.scenario = seeded;
    return runFault(catheter ? OperatedMachine::kCatheter : OperatedMachine::kCArm, kind, e.tree, e.nominal, of_run);
  });
  const Json json = faultExperimentAsJson(rows);
  e.report(json, faultExperimentTable);
  return json["unsafe"].get<int>() == 0 ? 0 : 1;
}

ServoSettings experimentSettings(const std::string& path) {
  ServoSettings usual;
  usual.scenario.calibration_error_deg = 1;
  usual.scenario.calibration_error_mm = 3;
  return readServoSettings(path, usual);
}

// Adds a sub-command with the options of all; calibration error, latency and duration come from `settings`. `what` its
// runs do is shown while they do it.
template <typename Run>
std::pair<cli::Command*, std::shared_ptr<ExperimentOptions>> addExperiment(cli::Command& app, Work& work,
                                                                           const Campaigns& campaigns, const char* name,
                                                                           const char* help, int runs, const char* what,
                                                                           Run run) {
  const auto o = std::make_shared<ExperimentOptions>();
  o->runs.count = runs;
  cli::Command* command = app.addSubcommand(name, help);
  command->addOption("--tree", o->tree, "Vessel tree");
  command->addOption("--calibration", o->calibration, "C-arm geometry and T_dsa_cb (.yaml): what is made wrong");
  addCenteredOption(*command, o->t_dsa_cb);
  command->addOption("--runs", o->runs.count, "How many runs")->check(cli::wholeBetween(1, 100000));
  command->addOption("--first-seed", o->runs.first_seed, "Seed of the first run; each has one more than the one before")
      ->check(cli::wholeBetween(0, 2147000000));
  command->addOption("--threads", o->runs.threads, "Runs at a time")->check(cli::wholeBetween(1, 256));
  o->patient.addTo(*command);
  addSettingsOptions(*command, o->settings, "Settings (.yaml), as angio-servo's",
                     [](const std::string& path) { return settingsAsYaml(experimentSettings(path)); });
  command->addOption("--out", o->out, "All runs and the settings (.json)");
  o->campaign.addTo(*command);
  command->onChosen([=, &work, &campaigns] {
    work = [=, &campaigns] {
      requireFolderOf(o->out);
      ServoSettings settings = experimentSettings(o->settings);
      o->patient.applyTo(settings.patient);
      const VesselTree tree = readVesselTree(o->tree);
      const CArmCalibration nominal = readCalibration("angio-simulate-loop", o->calibration, o->t_dsa_cb, tree);
      CampaignJob job{o->campaign, o->out, o->runs.count, {}, [&](const CampaignRun& campaign) {
                        Experiment e{*o, settings, tree, nominal, o->runs, campaign};
                        ProgressBar bar(what, campaign.share(o->runs.count));
                        e.runs.done = [&](int done) { bar.show(done); };
                        e.runs.campaign = campaign.rows;
                        return run(e);
                      }};
      for (const auto& path : {o->tree, o->calibration, o->settings, o->patient.deformation_field}) {
        addInput(job.inputs, path);
      }
      return campaigns.run(job);
    };
  });
  return {command, o};
}

void addExperiments(cli::Command& app, Work& work, const Campaigns& campaigns) {
  addExperiment(app, work, campaigns, "view", "Reach a view: true errors, settling times, limits", 100,
                "reaching views", simulateViews);
  addSimulateNavigate(app, work, campaigns);
  const auto [faults, of_faults] = addExperiment(
      app, work, campaigns, "faults",
      "Faults of network, clocks, images and programs: unsafe motions, recovery; exit code 1 on any unsafe one", 1000,
      "failing safely", failSafely);
  faults->addOption("--machine", of_faults->machine, "Whose loop: carm, catheter, or both by turns")
      ->check(cli::oneOf({"carm", "catheter", "both"}));
  const auto [centre, of_centre] =
      addExperiment(app, work, campaigns, "centre", "Keep a target centred while the patient breathes: true distances",
                    100, "keeping targets centred", keepCentered);
  centre->addOption("--duration-s", of_centre->center_duration_s, "Of each run")->check(cli::between(1.0, 3600.0));
  centre->addOption("--learn-s", of_centre->center.learn_s, "Errors count from then on");
  centre->addOption("--breathing-mm", of_centre->center.breathing_mm, "Of the target");
  centre->addOption("--heartbeat-mm", of_centre->center.heartbeat_mm, "Of the target");
}

}  // namespace

int report(Json json, const std::string& table, const Json& settings, const Json& machine, const std::string& out) {
  std::cout << table;
  if (out.empty()) return 0;
  json["settings"] = settings;
  if (!machine.is_null()) json["machine"] = machine;
  writeWholeFile(out, json.dump(2) + "\n");
  return 0;
}

}  // namespace angio::apps

int main(int argc, char** argv) {
  return angio::campaign::runCampaignProgram(
      {"angio-simulate-loop",
       "Runs the tasks in closed loops against the simulated lab, many times, and says how they ended.",
       "angio-simulate-loop view --runs 100 --threads 2 --out views.json",
       angio::apps::addExperiments,
       {}},
      argc, argv);
}

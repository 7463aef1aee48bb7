// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate-loop centre: a target in a breathing patient kept in the middle, images and registration in the loop.
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/experiments/centre_experiment.hpp"
#include "angio/io/whole_file.hpp"
#include "simulate_loop.hpp"

namespace angio::apps {
namespace {

int simulateCenterLoop(const ExperimentOptions& o, const CenterExperimentSettings& experiment, double duration_s) {
  requireFolderOf(o.out);
  ServoSettings settings = o.readSettings();
  settings.scenario.duration_s = duration_s;
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  const auto& center = settings.tasks.of<CenterTaskSettings>();
  const auto rows =
      o.runSeeds<CenterResult>("keeping targets centred", settings.scenario, [&](const ScenarioSettings& seeded) {
        return runCenterExperiment(tree, nominal, experiment, seeded, settings.loop(nominal), center, settings.patient);
      });
  const auto json = centerExperimentAsJson(rows, experiment);
  o.write(json, centerExperimentTable(json), settings);
  return 0;
}

}  // namespace

void addSimulateCenter(CLI::App& app, Work& work) {
  const auto o = std::make_shared<ExperimentOptions>();
  const auto experiment = std::make_shared<CenterExperimentSettings>();
  const auto duration_s = std::make_shared<double>(30);
  CLI::App* command = app.add_subcommand("centre", "Keep a target centred while the patient breathes: true distances");
  o->add(*command);
  command->add_option("--duration-s", *duration_s, "Of each run")->check(CLI::Range(1.0, 3600.0));
  command->add_option("--learn-s", experiment->learn_s, "Errors count from then on");
  command->add_option("--breathing-mm", experiment->breathing_mm, "Of the target");
  command->add_option("--heartbeat-mm", experiment->heartbeat_mm, "Of the target");
  command->callback([=, &work] { work = [=] { return simulateCenterLoop(*o, *experiment, *duration_s); }; });
}

}  // namespace angio::apps

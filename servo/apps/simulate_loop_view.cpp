// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate-loop view: from many starts to many views, images and registration in the loop.
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/experiments/view_experiment.hpp"
#include "angio/io/whole_file.hpp"
#include "simulate_loop.hpp"

namespace angio::apps {
namespace {

int simulateViews(const ExperimentOptions& o) {
  requireFolderOf(o.out);
  const ServoSettings settings = o.readSettings();
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  const ViewExperimentSettings experiment;
  const auto rows = o.runSeeds<ViewResult>("reaching views", settings.scenario, [&](const ScenarioSettings& seeded) {
    return runViewExperiment(tree, nominal, experiment, seeded, settings.loop(nominal), settings.patient);
  });
  const auto json = viewExperimentAsJson(rows, experiment);
  o.write(json, viewExperimentTable(json), settings);
  return 0;
}

}  // namespace

void addSimulateView(CLI::App& app, Work& work) {
  const auto o = std::make_shared<ExperimentOptions>();
  CLI::App* command = app.add_subcommand("view", "Reach a view: true errors, settling times, limits");
  o->add(*command);
  command->callback([o, &work] { work = [o] { return simulateViews(*o); }; });
}

}  // namespace angio::apps

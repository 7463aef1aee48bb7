// SPDX-License-Identifier: GPL-2.0-or-later
// angio-simulate-loop faults: networks, clocks, images and programs that fail while the loop moves the machine.
#include <memory>

#include "angio/apps/namespace.hpp"
#include "angio/experiments/fault_experiment.hpp"
#include "angio/io/whole_file.hpp"
#include "simulate_loop.hpp"

namespace angio::apps {
namespace {

struct FaultOptions : ExperimentOptions {
  std::string machine = "both";
};

int simulateFaults(const FaultOptions& o) {
  requireFolderOf(o.out);
  const ServoSettings settings = o.readSettings();
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  FaultParts parts;
  parts.carm_loop = settings.loop(nominal);
  parts.patient = settings.patient;
  const auto rows = o.runSeeds<FaultResult>("failing safely", settings.scenario, [&](const ScenarioSettings& seeded) {
    const bool both = o.machine == "both", catheter = both ? seeded.seed % 2 == 0 : o.machine == "catheter";
    const auto kind = static_cast<FaultKind>((both ? seeded.seed / 2 : seeded.seed) % kFaultKindCount);
    FaultParts of_run = parts;
    of_run.scenario = seeded;
    return catheter ? runFault(OperatedMachine::kCatheter, kind, tree, nominal, FaultExperimentSettings::forCatheter(),
                               of_run)
                    : runFault(OperatedMachine::kCArm, kind, tree, nominal, {}, of_run);
  });
  const auto json = faultExperimentAsJson(rows);
  o.write(json, faultExperimentTable(json), settings);
  return json["unsafe"].get<int>() == 0 ? 0 : 1;
}

}  // namespace

void addSimulateFaults(CLI::App& app, Work& work) {
  const auto o = std::make_shared<FaultOptions>();
  o->runs = 1000;
  CLI::App* command = app.add_subcommand(
      "faults",
      "Faults of network, clocks, images and programs: unsafe motions, recovery; exit code 1 on any unsafe one");
  o->add(*command);
  command->add_option("--machine", o->machine, "Whose loop: carm, catheter, or both by turns")
      ->check(CLI::IsMember({"carm", "catheter", "both"}));
  command->callback([o, &work] { work = [o] { return simulateFaults(*o); }; });
}

}  // namespace angio::apps

// SPDX-License-Identifier: GPL-2.0-or-later
// angio-rehearse faults: networks, clocks, images and programs that fail while the loop moves the machine.
#include <memory>

#include "angio/io/whole_file.hpp"
#include "angio/rehearsal/fault_campaign.hpp"
#include "rehearse.hpp"

namespace angio {
namespace {

struct FaultOptions : StudyOptions {
  std::string machine = "both";
};

int rehearseFaults(const FaultOptions& o) {
  requireFolderOf(o.out);
  const ServoSettings settings = o.readSettings();
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  FaultParts parts;
  parts.carm_loop = settings.loop(nominal);
  parts.patient = settings.patient;
  const auto rows = o.runSeeds<FaultRow>("failing safely", settings.rehearsal, [&](const RehearsalSettings& seeded) {
    const bool both = o.machine == "both", catheter = both ? seeded.seed % 2 == 0 : o.machine == "catheter";
    const auto kind = static_cast<FaultKind>((both ? seeded.seed / 2 : seeded.seed) % kFaultKindCount);
    FaultParts of_run = parts;
    of_run.rehearsal = seeded;
    return catheter
               ? runFault(OperatedMachine::kCatheter, kind, tree, nominal, FaultCampaignSettings::forCatheter(), of_run)
               : runFault(OperatedMachine::kCArm, kind, tree, nominal, {}, of_run);
  });
  const auto json = faultCampaignAsJson(rows);
  o.write(json, faultCampaignTable(json), settings);
  return json["unsafe"].get<int>() == 0 ? 0 : 1;
}

}  // namespace

void addRehearseFaults(CLI::App& app, Work& work) {
  const auto o = std::make_shared<FaultOptions>();
  o->runs = 1000;
  CLI::App* command = app.add_subcommand(
      "faults",
      "Faults of network, clocks, images and programs: unsafe motions, recovery; exit code 1 on any unsafe one");
  o->add(*command);
  command->add_option("--machine", o->machine, "Whose loop: carm, catheter, or both by turns")
      ->check(CLI::IsMember({"carm", "catheter", "both"}));
  command->callback([o, &work] { work = [o] { return rehearseFaults(*o); }; });
}

}  // namespace angio

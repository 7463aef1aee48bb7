// SPDX-License-Identifier: GPL-2.0-or-later
// angio-rehearse faults: networks, clocks, images and programs that fail while the loop moves the machine.
#include <memory>

#include "angio/io/whole_file.hpp"
#include "angio/rehearsal/fault_campaign.hpp"
#include "rehearse.hpp"

namespace angio {
namespace {

int rehearseFaults(const StudyOptions& o) {
  requireFolderOf(o.out);
  const ServoSettings settings = o.readSettings();
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  const auto rows = o.runSeeds<FaultRow>("failing safely", settings.rehearsal, [&](const RehearsalSettings& seeded) {
    const auto kind = static_cast<FaultKind>(seeded.seed % kFaultKindCount);
    return runFault(tree, nominal, {}, kind, seeded, settings.loop(nominal), settings.patient);
  });
  const auto json = faultCampaignAsJson(rows);
  o.write(json, faultCampaignTable(json), settings);
  return json["all"]["unsafe"].get<int>() == 0 ? 0 : 1;
}

}  // namespace

void addRehearseFaults(CLI::App& app, Work& work) {
  const auto o = std::make_shared<StudyOptions>();
  o->runs = 1000;
  CLI::App* command = app.add_subcommand(
      "faults",
      "Faults of network, clocks, images and programs: unsafe motions, recovery; exit code 1 on any unsafe one");
  o->add(*command);
  command->callback([o, &work] { work = [o] { return rehearseFaults(*o); }; });
}

}  // namespace angio

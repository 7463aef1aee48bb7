// SPDX-License-Identifier: GPL-2.0-or-later
// angio-rehearse centre: a target in a breathing patient kept in the middle, images and registration in the loop.
#include <memory>

#include "angio/io/whole_file.hpp"
#include "angio/rehearsal/centre_study.hpp"
#include "rehearse.hpp"

namespace angio {
namespace {

int rehearseCentre(const StudyOptions& o, const CentreStudySettings& study, double duration_s) {
  requireFolderOf(o.out);
  ServoSettings settings = o.readSettings();
  settings.rehearsal.duration_s = duration_s;
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  const auto& centre = settings.tasks.of<CentreTaskSettings>();
  const auto rows =
      o.runSeeds<CentreStudyRow>("keeping targets centred", settings.rehearsal, [&](const RehearsalSettings& seeded) {
        return studyCentre(tree, nominal, study, seeded, settings.loop(nominal), centre, settings.patient);
      });
  const auto json = centreStudyAsJson(rows, study);
  o.write(json, centreStudyTable(json), settings);
  return 0;
}

}  // namespace

void addRehearseCentre(CLI::App& app, Work& work) {
  const auto o = std::make_shared<StudyOptions>();
  const auto study = std::make_shared<CentreStudySettings>();
  const auto duration_s = std::make_shared<double>(30);
  CLI::App* command = app.add_subcommand("centre", "Keep a target centred while the patient breathes: true distances");
  o->add(*command);
  command->add_option("--duration-s", *duration_s, "Of each run")->check(CLI::Range(1.0, 3600.0));
  command->add_option("--learn-s", study->learn_s, "Errors count from then on");
  command->add_option("--breathing-mm", study->breathing_mm, "Of the target");
  command->add_option("--heartbeat-mm", study->heartbeat_mm, "Of the target");
  command->callback([=, &work] { work = [=] { return rehearseCentre(*o, *study, *duration_s); }; });
}

}  // namespace angio

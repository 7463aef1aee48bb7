// SPDX-License-Identifier: GPL-2.0-or-later
// angio-rehearse view: from many starts to many views, images and registration in the loop.
#include <memory>

#include "angio/io/whole_file.hpp"
#include "angio/rehearsal/view_study.hpp"
#include "rehearse.hpp"

namespace angio {
namespace {

int rehearseViews(const StudyOptions& o) {
  requireFolderOf(o.out);
  const ServoSettings settings = o.readSettings();
  const VesselTree tree = o.readTree();
  const CArmCalibration nominal = o.readCalibration();
  const ViewStudySettings study;
  const auto rows =
      o.runSeeds<ViewStudyRow>("reaching views", settings.rehearsal, [&](const RehearsalSettings& seeded) {
        return studyView(tree, nominal, study, seeded, settings.loop(nominal), settings.patient);
      });
  const auto json = viewStudyAsJson(rows, study);
  o.write(json, viewStudyTable(json), settings);
  return 0;
}

}  // namespace

void addRehearseView(CLI::App& app, Work& work) {
  const auto o = std::make_shared<StudyOptions>();
  CLI::App* command = app.add_subcommand("view", "Reach a view: true errors, settling times, limits");
  o->add(*command);
  command->callback([o, &work] { work = [o] { return rehearseViews(*o); }; });
}

}  // namespace angio

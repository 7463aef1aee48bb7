// SPDX-License-Identifier: GPL-2.0-or-later
// angio-rehearse view: from many starts to many views, images and registration in the loop.
#include <memory>

#include "angio/cli/progress_bar.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/rehearsal/seeds.hpp"
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
  std::vector<ViewStudyRow> rows(static_cast<std::size_t>(o.runs));
  ProgressBar bar("reaching views", o.runs);
  forEachInParallel(
      o.runs, o.threads,
      [&](int k) {
        RehearsalSettings rehearsal = settings.rehearsal;
        rehearsal.seed = o.first_seed + k;
        rows[static_cast<std::size_t>(k)] =
            studyView(tree, nominal, study, rehearsal, settings.loop(nominal), settings.patient);
      },
      [&](int done) { bar.show(done); });
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

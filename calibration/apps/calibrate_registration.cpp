// SPDX-License-Identifier: GPL-2.0-or-later
// angio-calibrate registration: T_dsa_cb from the anatomy itself, registered in several views.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "anatomy_cases.hpp"
#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/pose_pictures.hpp"
#include "angio/cli/program.hpp"
#include "angio/cli/progress_bar.hpp"
#include "angio/io/image_files.hpp"
#include "calibrate.hpp"
#include "outputs.hpp"

namespace angio::apps {
namespace {

struct RegistrationOptions {
  AnatomyAsked asked;
  std::string out, report;
  bool leave_one_out = false;
};

std::string leaveOneOutTable(const std::vector<LeftOutView>& left_out) {
  std::string table = "\nleft out    predicted rotation off [deg]   T_dsa_cb of the others moves by [deg]\n";
  for (const LeftOutView& view : left_out) {
    table +=
        formatted("%-10s  %28.3f  %38.3f\n", view.name.c_str(), radToDeg(view.rotation_rad), radToDeg(view.moved_rad));
  }
  return table;
}

// For a person: T_dsa_cb, the runs' shifts, each view against the others. `left_out` names those that were not
// registered.
std::string anatomyTable(const AnatomyResult& result, const std::vector<CaseOutcome>& outcomes,
                         const std::string& left_out) {
  std::string table = transformRow("T_dsa_cb", result.T_dsa_cb, result.covariance);
  for (const RunShift& run : result.runs) {
    const Eigen::Vector3d s = run.covariance.diagonal().cwiseSqrt();
    table += formatted("shift of %-6s", run.run.c_str());
    for (int k = 0; k < 3; ++k) table += formatted("  %9.3f +- %-7.3f", 1e3 * run.shift_m[k], 1e3 * s[k]);
    table += " mm\n";
  }
  table += "\nview        registered   by the angles off [deg]  [mm]     sigmas   by the other views off [deg]\n";
  for (const AnatomyViewFit& view : result.views) {
    const auto outcome =
        std::find_if(outcomes.begin(), outcomes.end(), [&](const auto& o) { return o.name == view.name; });
    table += formatted("%-10s  %-10s  %22.3f  %8.3f  %5.2f   ", view.name.c_str(),
                       statusName(outcome->result.status).c_str(), radToDeg(view.rotation_rad),
                       1e3 * view.translation_m, view.sigmas);
    table += view.outlier                 ? "outlier"
             : view.held_out_rotation_rad ? formatted("%.3f", radToDeg(*view.held_out_rotation_rad))
                                          : "-";
    table += "\n";
  }
  if (!left_out.empty()) table += "left out        " + left_out + "\n";
  if (result.held_out_rotation_rms_rad) {
    table += formatted("held out, rms   %.3f deg\n", radToDeg(*result.held_out_rotation_rms_rad));
  }
  return table + formatted("chi2 per degree of freedom %.2f\n", result.chi2_per_freedom);
}

// Each view's overlay and how far it is from the others, as pictures and a page with `table`.
void writeAnatomyReport(const std::string& folder, const std::string& cases_path, const AnatomyResult& result,
                        const SeenViews& anatomy, const VesselTree& tree, const std::string& table) {
  std::vector<ReportPicture> overlays;
  constexpr std::size_t kShown = 4;  // In the overview.
  for (std::size_t i = 0; i < anatomy.views.size(); ++i) {
    const auto& path = anatomy.image_paths[i];
    overlays.push_back(
        {formatted("view-%03zu.png", i + 1), anatomy.views[i].name,
         anatomyOverlay(result, anatomy.views[i], anatomy.seen[i], tree, path ? readXrayImage(*path) : cv::Mat()),
         i < kShown});
  }
  writeReport(folder, "T_dsa_cb from the anatomy", cases_path,
              {{"Views against each other",
                "",
                {{"residuals.png", "A view's own registration against that of all views", anatomyResiduals(result)}}},
               {"Views", "", overlays},
               {"Numbers", printed(table), {}}});
}

int runRegistration(const RegistrationOptions& o) {
  const ClaimedOutputs claimed(o.out, o.report);
  const AnatomyCases cases = readAnatomyCases(o.asked);
  ProgressBar bar("registering", static_cast<int>(cases.set.cases.size()));
  const RegisteredAnatomy found = registerViews(cases, o.asked, [&](int done) { bar.show(done); });
  const AnatomyResult result = anatomyOf(found.seen, cases.tree, o.asked);
  if (!o.out.empty()) writeAnatomy(o.out, cases, o.asked, result);
  const std::string text = anatomyTable(result, found.outcomes, found.left_out);
  if (!o.report.empty()) writeAnatomyReport(o.report, o.asked.cases, result, found.seen, cases.tree, text);
  std::cout << text;
  if (o.leave_one_out) std::cout << leaveOneOutTable(leaveOneOut(result, found.seen, cases.tree, o.asked));
  return 0;
}

}  // namespace

void addCalibrateRegistration(cli::Command& app, Work& work) {
  const auto o = std::make_shared<RegistrationOptions>();
  auto* command =
      app.addSubcommand("registration", "T_dsa_cb and a shift per run from the anatomy, registered in several views");
  command->footer(
      "Examples:\n  angio-calibrate registration cases.yaml --carm carm.yaml --out lab.yaml\n"
      "  angio-calibrate registration examples/data/static-phantom/cases.yaml --leave-one-out");
  command->addOption("cases", o->asked.cases, "Case set (cases.yaml) of one tree; each case's first view is used")
      ->required();
  command->addOption("--angles", o->asked.angles,
                     "The C-arm's angles (.yaml); otherwise angles.yaml beside the case set, or those of DICOM images");
  command->addOption("--carm", o->asked.carm, "C-arm file (.yaml): the result is this file with T_dsa_cb");
  command->addOption("--out", o->out, "Result (.yaml)");
  command->addOption("--report", o->report, "Folder for pictures and a page (index.html)");
  command->addOption("--run", o->asked.run, "T_dsa_cb of this run, its shift included, instead of the runs' mean");
  command->addOption("--method", o->asked.method, "Registration method");
  command
      ->addOption("--search-rotation-deg", o->asked.search_rotation_deg,
                  "Poses are searched so far about the initial ones")
      ->check(between(0, 180));
  command->addOption("--search-translation-mm", o->asked.search_translation_mm, "and so far along each axis")
      ->check(between(0, 1000));
  command->addOption("--angle-sigma-deg", o->asked.settings.angle_std_deg, "Errors of the C-arm's angles")
      ->check(between(1e-4, 30));
  command
      ->addOption("--shift-sigma-mm", o->asked.settings.shift_std_mm,
                  "The isocentre moves so much from run to run; 0: not at all")
      ->check(between(0, 1000));
  command
      ->addOption("--outlier-gate", o->asked.settings.outlier_gate, "Views further off than so many sigma are left out")
      ->check(between(2, 100));
  command->addFlag("--refine,!--no-refine", o->asked.refine, "Refine jointly on the image points of all views");
  command->addFlag("--leave-one-out", o->leave_one_out, "Also each view's rotation as the others alone predict it");
  command->onChosen([o, &work] { work = [o] { return runRegistration(*o); }; });
}

}  // namespace angio::apps

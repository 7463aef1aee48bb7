// SPDX-License-Identifier: GPL-2.0-or-later

#include <algorithm>
#include <cmath>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration/anatomy_pictures.hpp"
#include "angio/io/image_files.hpp"
#include "outputs.hpp"
#include "report_folder.hpp"

namespace angio::apps {

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

void writeAnatomyReport(const std::string& folder, const std::string& cases_path, const AnatomyResult& result,
                        const ReportedAnatomy& anatomy, const std::string& table) {
  std::vector<ReportPicture> overlays;
  constexpr std::size_t kShown = 4;  // In the overview.
  for (std::size_t i = 0; i < anatomy.views.size(); ++i) {
    const auto& path = anatomy.image_paths[i];
    overlays.push_back({formatted("view-%03zu.png", i + 1), anatomy.views[i].name,
                        anatomyOverlay(result, anatomy.views[i], anatomy.seen[i], anatomy.tree,
                                       path ? readXrayImage(*path) : cv::Mat()),
                        i < kShown});
  }
  writeReport(folder, "T_dsa_cb from the anatomy", cases_path,
              {{"Views against each other",
                "",
                {{"residuals.png", "A view's own registration against that of all views", anatomyResiduals(result)}}},
               {"Views", "", overlays},
               {"Numbers", printed(table), {}}});
}

}  // namespace angio::apps

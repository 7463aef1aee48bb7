// SPDX-License-Identifier: GPL-2.0-or-later
// angio-best-view: from where a vessel is seen with least foreshortening and overlap, and what every other view costs.
#include <iostream>

#include "angio/apps/namespace.hpp"
#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "servo_settings.hpp"
#include "view_map_picture.hpp"

namespace angio::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string tree = exampleDataFile("hepatic-tace/tree.csv");
  std::string calibration = exampleDataFile("hepatic-tace/carm.yaml");
  int branch = -1, from = -1, to = -1;
  std::string settings, picture, out;
};

// What a person chooses from.
void listBranches(const VesselTree& tree) {
  std::cout << formatted("%8s%12s%12s%14s%12s\n", "branch", "from point", "to point", "length [mm]", "radius [mm]");
  for (std::size_t k = 0; k < tree.branches().size(); ++k) {
    const TreeSegment& branch = tree.branches()[k];
    double length_m = 0;
    for (std::size_t i = 1; i < branch.size(); ++i) {
      length_m += (tree.points().col(branch[i]) - tree.points().col(branch[i - 1])).norm();
    }
    const auto radius_m = tree.radii()[static_cast<std::size_t>(branch[branch.size() / 2])];
    std::cout << formatted("%8d%12d%12d%14.1f%12s\n", static_cast<int>(k), branch.front(), branch.back(),
                           1e3 * length_m, radius_m ? formatted("%.2f", 1e3 * *radius_m).c_str() : "unknown");
  }
}

// Rows by secondary, columns by primary angle; null out of reach.
Json rowsOf(const Eigen::MatrixXf& cost, const ViewMap& map) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < cost.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < cost.cols(); ++j) row.push_back(map.reachable(i, j) ? Json(cost(i, j)) : Json());
    rows.push_back(row);
  }
  return rows;
}

Json asJson(const BestView& best, const BestViewSettings& settings) {
  const ViewMap& map = best.map;
  return {{"primary_deg", radToDeg(best.angles.primary_rad)},
          {"secondary_deg", radToDeg(best.angles.secondary_rad)},
          {"foreshortening", best.cost.foreshortening},
          {"overlap", best.cost.overlap},
          {"target_mm", {1e3 * best.target_model.x(), 1e3 * best.target_model.y(), 1e3 * best.target_model.z()}},
          {"map",
           {{"step_deg", radToDeg(map.step_rad)},
            {"first_primary_deg", radToDeg(map.first_primary_rad)},
            {"first_secondary_deg", radToDeg(map.first_secondary_rad)},
            {"foreshortening", rowsOf(map.foreshortening, map)},
            {"overlap", rowsOf(map.overlap, map)}}},
          {"settings", settingsAsJson(settings)}};
}

int showBestView(const Options& o) {
  requireFolderOf(o.picture);
  requireFolderOf(o.out);
  const VesselTree tree = readVesselTree(o.tree);
  if (o.branch < 0 && o.from < 0) {
    listBranches(tree);
    return 0;
  }
  const ServoSettings lab = readServoSettings(o.settings);
  const BestViewSettings& settings = lab.tasks.of<ViewTaskSettings>().best_view;
  const CArmCalibration calibration = readCArmCalibration(o.calibration);
  const ServoLoopSettings loop = lab.loop(calibration);
  const BestViewScene scene = bestViewScene(loop.carm, loop.limits, loop.R_lps_model);
  const TreeSegment segment = o.branch >= 0 ? segmentOfBranch(tree, o.branch) : segmentBetween(tree, o.from, o.to);
  const BestView best = bestView(tree, segment, scene, settings);
  std::cout << formatted("best view       %s\nforeshortening  %.1f %%\noverlap         %.1f %%\n",
                         inWords(best.angles).c_str(), 100 * best.cost.foreshortening, 100 * best.cost.overlap);
  if (!o.picture.empty()) {
    writeImage(o.picture, viewMapPicture(tree, segment, best, scene, settings.overlap_weight));
  }
  if (!o.out.empty()) writeWholeFile(o.out, asJson(best, settings).dump(2) + "\n");
  return 0;
}

}  // namespace
}  // namespace angio::apps

int main(int argc, char** argv) {
  CLI::App app(
      "Finds the view of least foreshortening and overlap of a vessel, over all angles that the arm reaches. Without a "
      "vessel: lists the tree's branches.",
      "angio-best-view");
  angio::apps::describeProgram(app, "angio-best-view --branch 12 --picture map.png");
  angio::apps::Options o;
  app.add_option("--tree", o.tree, "Vessel tree");
  app.add_option("--calibration", o.calibration, "C-arm geometry, and how the patient's axes lie (.yaml)");
  auto* branch =
      app.add_option("--branch", o.branch, "Vessel: the branch of this number")->check(CLI::Range(0, 1000000000));
  auto* from =
      app.add_option("--from-point", o.from, "Or: from this point of the tree ...")->check(CLI::Range(0, 1000000000));
  auto* to = app.add_option("--to-point", o.to, "... downstream to this one")->check(CLI::Range(0, 1000000000));
  from->needs(to)->excludes(branch);
  to->needs(from);
  app.add_option("--settings", o.settings, "Settings (.yaml), as angio-servo's: limits, and view's best_view");
  app.add_option("--picture", o.picture, "The map, drawn (.png, .jpg)");
  app.add_option("--out", o.out, "The map, in numbers (.json)");
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::showBestView(o); });
}

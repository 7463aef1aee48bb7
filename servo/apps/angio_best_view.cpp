// SPDX-License-Identifier: GPL-2.0-or-later
// angio-best-view: from where a vessel is seen with least foreshortening and overlap, and what every other view costs.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "angio/base/formatted.hpp"
#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/cli/data_folder.hpp"
#include "angio/cli/program.hpp"
#include "angio/io/image_files.hpp"
#include "angio/io/settings_files.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/results/overlay.hpp"
#include "angio/servo/best_view.hpp"
#include "angio/servo/desired_view.hpp"
#include "servo_settings.hpp"

namespace angio::apps {
namespace {

constexpr int kMapWidth_px = 520, kScaleWidth_px = 100, kHeight_px = 290;
constexpr int kTick_deg = 30;
const cv::Scalar kInk(40, 40, 40), kOutOfReach(200, 200, 200), kVessel(150, 130, 120), kSegment(0, 94, 213);

cv::Mat3b colored(const cv::Mat1f& share) {
  cv::Mat1b levels;
  share.convertTo(levels, CV_8U, 255);
  cv::Mat3b colors;
  cv::applyColorMap(levels, colors, cv::COLORMAP_VIRIDIS);
  return colors;
}

// Angles from -most to most, named by the beam's sides.
PlotAxis angleAxis(double first_rad, double step_rad, Eigen::Index count, const char* below, const char* above) {
  const double first_deg = radToDeg(first_rad), step_deg = radToDeg(step_rad);
  PlotAxis axis;
  axis.range = {first_deg - 0.5 * step_deg, first_deg + (static_cast<double>(count) - 0.5) * step_deg};
  axis.ticks.emplace();
  const int most = static_cast<int>(-first_deg + 1e-6) / kTick_deg * kTick_deg;
  for (int d = -most; d <= most; d += kTick_deg) {
    axis.ticks->emplace_back(d, d == 0 ? "0" : formatted("%s %d", d < 0 ? below : above, std::abs(d)));
  }
  return axis;
}

// One cost over the angles with its colours' scale; the best view is marked.
cv::Mat mapOf(const std::string& title, const ViewMap& map, const Eigen::MatrixXf& cost, float most,
              const ViewAngles& best) {
  Plot plot{title, angleAxis(map.first_primary_rad, map.step_rad, cost.cols(), "RAO", "LAO"),
            angleAxis(map.first_secondary_rad, map.step_rad, cost.rows(), "CAU", "CRA")};
  cv::Mat1f share(static_cast<int>(cost.rows()), static_cast<int>(cost.cols()));
  for (int y = 0; y < share.rows; ++y) {
    for (int x = 0; x < share.cols; ++x) share(y, x) = cost(share.rows - 1 - y, x) / most;
  }
  cv::Mat3b cells = colored(share);
  for (int y = 0; y < cells.rows; ++y) {
    for (int x = 0; x < cells.cols; ++x) {
      if (!map.reachable(cells.rows - 1 - y, x))
        cells(y, x) = cv::Vec3b::all(static_cast<std::uint8_t>(kOutOfReach[0]));
    }
  }
  plot.ground = cells;
  const double x = radToDeg(best.primary_rad), y = radToDeg(best.secondary_rad);
  plot.series = {{"", {x, x}, {y, y}, kWarningColor, PlotSeries::Kind::kDots}};
  plot.series[0].radii_px = {9, 3};
  plot.series[0].hollow = {true, false};
  Plot scale{"", {}, {"", false, std::pair(0, most)}};
  scale.x.ticks.emplace();
  cv::Mat1f ramp(256, 1);
  for (int i = 0; i < ramp.rows; ++i) ramp(i, 0) = 1 - static_cast<float>(i) / 255;
  scale.ground = colored(ramp);
  return sideBySide({drawPlots({plot}, kMapWidth_px, kHeight_px), drawPlots({scale}, kScaleWidth_px, kHeight_px)});
}

// The tree as a view has it, filling a square.
void drawTree(cv::Mat picture, const VesselTree& tree, const TreeSegment& segment, const Pose& T_camera_model,
              const std::string& title) {
  const Eigen::Matrix3Xd seen = (T_camera_model.linear() * tree.points()).colwise() + T_camera_model.translation();
  const Eigen::Matrix2Xd rays = seen.colwise().hnormalized();
  const Eigen::Vector2d middle = 0.5 * (rays.rowwise().minCoeff() + rays.rowwise().maxCoeff());
  const double extent = (rays.rowwise().maxCoeff() - rays.rowwise().minCoeff()).maxCoeff();
  const double px_per_ray = 0.88 * picture.cols / std::max(extent, 1e-9);
  const auto line = [&](int a, int b, const cv::Scalar& color, int thinnest_px) {
    const auto pixel = [&](int i) {
      const Eigen::Vector2d p = px_per_ray * (rays.col(i) - middle);
      return cv::Point(cvRound(p.x()) + picture.cols / 2, cvRound(p.y()) + picture.rows / 2 + 10);
    };
    const double radius_m = tree.radii()[static_cast<std::size_t>(b)].value_or(0);
    const int width_px = std::max(thinnest_px, cvRound(2 * px_per_ray * radius_m / seen(2, b)));
    cv::line(picture, pixel(a), pixel(b), color, width_px, cv::LINE_AA);
  };
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    if (parent >= 0) line(parent, i, kVessel, 1);
  }
  for (std::size_t k = 1; k < segment.size(); ++k) line(segment[k - 1], segment[k], kSegment, 2);
  cv::putText(picture, title, {12, 22}, cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk, 1, cv::LINE_AA);
  cv::rectangle(picture, cv::Rect(0, 0, picture.cols, picture.rows), kOutOfReach);
}

// "LAO 23.4, CAU 10.1".
std::string inWords(const ViewAngles& angles) {
  const double primary_deg = radToDeg(angles.primary_rad), secondary_deg = radToDeg(angles.secondary_rad);
  return formatted("%s %.1f, %s %.1f", primary_deg < 0 ? "RAO" : "LAO", std::abs(primary_deg),
                   secondary_deg < 0 ? "CAU" : "CRA", std::abs(secondary_deg));
}

// What each view of a segment costs, CV_8UC3: foreshortening, overlap and their weighted sum over primary angle (to the
// right LAO) and secondary angle (up CRA), out of reach grey, the best view marked; and beside them the tree from the
// front and in the best view, with the segment picked out.
cv::Mat viewMapPicture(const VesselTree& tree, const TreeSegment& segment, const BestView& best,
                       const BestViewScene& scene, double overlap_weight) {
  const auto weight = static_cast<float>(overlap_weight);
  cv::Mat maps;
  cv::vconcat(std::vector<cv::Mat>{mapOf(formatted("foreshortening: %.1f %% at best", 100 * best.cost.foreshortening),
                                         best.map, best.map.foreshortening, 1, best.angles),
                                   mapOf(formatted("overlap: %.1f %% at best", 100 * best.cost.overlap), best.map,
                                         best.map.overlap, 1, best.angles),
                                   mapOf(formatted("cost: foreshortening + %.3g overlap", overlap_weight), best.map,
                                         best.map.foreshortening + weight * best.map.overlap, 1 + weight, best.angles)},
              maps);
  const int side_px = maps.rows / 2;
  cv::Mat views(maps.rows, side_px, CV_8UC3, cv::Scalar::all(255));
  const auto square = [&](int y_px) { return views(cv::Rect(0, y_px, side_px, side_px)); };
  const auto pose = [&](const ViewAngles& angles) {
    return desiredPose({angles, best.target_model, scene.R_lps_model}, scene.source_isocenter_distance_m);
  };
  drawTree(square(0), tree, segment, pose({0, 0}), "from the front");
  drawTree(square(side_px), tree, segment, pose(best.angles), "best view: " + inWords(best.angles));
  return sideBySide({maps, views});
}

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
  requireImagePath(o.picture);
  requireFolderOf(o.out);
  const VesselTree tree = readVesselTree(o.tree);
  if (o.branch < 0 && o.from < 0) {
    listBranches(tree);
    return 0;
  }
  const ServoSettings lab = readServoSettings(o.settings);
  const BestViewSettings& settings = lab.tasks.of<ViewTaskSettings>().best_view;
  const CArmCalibration calibration = readCArmCalibration(o.calibration, tree);
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
  angio::cli::Command app(
      "Finds the view of least foreshortening and overlap of a vessel, over all angles that the arm reaches. Without a "
      "vessel: lists the tree's branches.",
      "angio-best-view");
  angio::apps::describeProgram(app, "angio-best-view --branch 12 --picture map.png");
  angio::apps::Options o;
  app.addOption("--tree", o.tree, "Vessel tree");
  app.addOption("--calibration", o.calibration, "C-arm geometry, and how the patient's axes lie (.yaml)");
  auto* branch = app.addOption("--branch", o.branch, "Vessel: the branch of this number")
                     ->check(angio::cli::wholeBetween(0, 1000000000));
  auto* from = app.addOption("--from-point", o.from, "Or: from this point of the tree ...")
                   ->check(angio::cli::wholeBetween(0, 1000000000));
  auto* to =
      app.addOption("--to-point", o.to, "... downstream to this one")->check(angio::cli::wholeBetween(0, 1000000000));
  from->needs(to)->excludes(branch);
  to->needs(from);
  angio::apps::addSettingsOptions(app, o.settings, "Settings (.yaml), as angio-servo's: limits, and view's best_view",
                                  angio::apps::servoSettingsAsYaml);
  app.addOption("--picture", o.picture, "The map, drawn (.png, .jpg)");
  app.addOption("--out", o.out, "The map, in numbers (.json)");
  return angio::apps::runProgram(app, argc, argv, [&] { return angio::apps::showBestView(o); });
}

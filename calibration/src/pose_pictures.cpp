// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/pose_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/plotting/plot.hpp"
#include "angio/results/overlay.hpp"

namespace angio::calibration {
namespace {

// Named values of views or poses as bars beside each other; those that were left out are red.
struct BarChart {
  Plot plot;

  BarChart(const std::string& title, const std::string& unit, int color = 0) : plot{title, {}, {unit}} {
    plot.x.ticks.emplace();
    constexpr auto kBars = PlotSeries::Kind::kBars;
    plot.series = {{"", {}, {}, color, kBars}, {"", {}, {}, kWarningColor, kBars}};
  }

  void add(const std::string& name, double value, bool left_out) {
    const auto at = static_cast<double>(plot.x.ticks->size());
    plot.x.ticks->emplace_back(at, name);
    plot.x.range = {-0.6, at + 0.6};
    plot.series[left_out ? 1 : 0].x.push_back(at);
    plot.series[left_out ? 1 : 0].y.push_back(value);
  }
};

constexpr int kMain = 1;  // Vermilion.

// Equal areas, z towards the reader; of an axis' two ends the one in front. Source: Lambert's azimuthal projection.
Eigen::Vector2d onDisc(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d front = axis.z() < 0 ? Eigen::Vector3d(-axis) : axis;
  return front.head<2>() / std::sqrt(1 + front.z());
}

cv::Mat ellipsoidBars(const std::string& title, const std::string& unit, const Eigen::Matrix3d& covariance,
                      double per_unit, int color) {
  const SymmetricEigen3 axes = eigenOfSymmetric(covariance);
  BarChart bars{title, unit, color};
  for (int k = 2; k >= 0; --k) {
    const Eigen::Vector3d axis = withPositiveLargest(axes.vectors.col(k));
    bars.add(formatted("%.2f %.2f %.2f", axis.x(), axis.y(), axis.z()),
             per_unit * std::sqrt(std::max(0.0, axes.values[k])), false);
  }
  return drawPlots({bars.plot}, 520, 270);
}

const AnatomyViewFit* fitOf(const AnatomyResult& result, const std::string& name) {
  const auto fit =
      std::find_if(result.views.begin(), result.views.end(), [&](const auto& one) { return one.name == name; });
  return fit == result.views.end() ? nullptr : &*fit;
}

Pose jointPose(const AnatomyResult& result, const AnatomyView& view) {
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  for (const RunShift& run : result.runs) {
    if (run.run == view.run) shift_m = run.shift_m;
  }
  return view.T_camera_patient * Eigen::Translation3d(shift_m) * result.T_dsa_cb;
}

}  // namespace

cv::Mat poseResiduals(const HandEyeResult& result) {
  const int outliers = result.outliers();
  const std::string left_out = outliers == 0 ? "" : formatted("; %d left out (red)", outliers);
  BarChart turns{formatted("Turn of each pose, rms %.3f deg", radToDeg(result.residuals.rotation_rad)) + left_out,
                 "deg"},
      places{formatted("Place of each pose, rms %.3f mm", 1e3 * result.residuals.translation_m) + left_out, "mm"};
  for (const HandEyePoseFit& pose : result.poses) {
    turns.add(pose.name, radToDeg(pose.rotation_rad), pose.outlier);
    places.add(pose.name, 1e3 * pose.translation_m, pose.outlier);
  }
  return drawPlots({turns.plot, places.plot}, 720, 270);
}

cv::Mat turnAxes(const PoseSet& set) {
  const HandEyeEquations equations = handEyeEquations(set);
  const MotionSpread spread = motionSpread(equations);
  PlotAxis axis{set.setup == HandEyeSetup::kEyeInHand ? "x of the hand" : "x of the base", false,
                std::pair(-1.15, 1.15)};
  axis.ticks.emplace();
  Plot plot{formatted("Turns, rms: %.1f deg about the main axis, %.1f across", radToDeg(spread.along_rad),
                      radToDeg(spread.across_rad)),
            axis, axis};
  plot.y.label = "y";
  plot.equal_scale = true;
  plot.guides = {{0, ""}, {0, "", true}};
  for (const double from_z_deg : {30.0, 60.0, 90.0}) {
    PlotSeries circle{"", {}, {}, kInkColor};
    circle.dashed = true;
    const double radius = std::sqrt(2.0) * std::sin(0.5 * degToRad(from_z_deg));
    for (int degrees = 0; degrees <= 360; degrees += 4) {
      circle.x.push_back(radius * std::cos(degToRad(degrees)));
      circle.y.push_back(radius * std::sin(degToRad(degrees)));
    }
    plot.series.push_back(circle);
  }
  PlotSeries turns{"", {}, {}, 0, PlotSeries::Kind::kDots};
  for (std::size_t i = 0; i < equations.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const Eigen::Vector3d turn = logSO3(equations.hands[k].linear().transpose() * equations.hands[i].linear());
      const double angle = turn.norm();
      if (angle < 1e-6) continue;
      const Eigen::Vector2d at = onDisc(turn / angle);
      turns.x.push_back(at.x());
      turns.y.push_back(at.y());
      turns.radii_px.push_back(1 + 5 * std::sqrt(angle / std::max(spread.max_turn_rad, angle)));
    }
  }
  const Eigen::Vector2d main = onDisc(spread.main_axis);
  PlotSeries ring{"", {main.x()}, {main.y()}, kMain, PlotSeries::Kind::kDots};
  ring.hollow = {true};
  ring.radii_px = {11};
  plot.series.insert(plot.series.end(), {turns, ring});
  plot.texts = {{0, 0, "z", kInkColor}, {main.x(), main.y(), "main axis", kMain, {-30, -16}}};
  return drawPlots({plot}, 560, 540);
}

cv::Mat covarianceBars(const PoseSet& set, const HandEyeResult& result) {
  const auto [X, Z] = transformNames(set.setup);
  std::vector<std::string> names{Z};
  if (result.covariance.rows() == 12) names.insert(names.begin(), X);
  std::vector<cv::Mat> rows;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(6 * k);
    const auto& C = result.covariance;
    rows.push_back(
        sideBySide({ellipsoidBars(names[k] + ": place, sigma", "mm", C.block<3, 3>(at, at), 1e3, 0),
                    ellipsoidBars(names[k] + ": turn, sigma", "deg", C.block<3, 3>(at + 3, at + 3), radToDeg(1), 4)}));
  }
  cv::Mat all;
  cv::vconcat(rows, all);
  return all;
}

cv::Mat anatomyOverlay(const AnatomyResult& result, const AnatomyView& view, const SeenAnatomy& seen,
                       const VesselTree& tree, const cv::Mat& image) {
  OverlayScene scene;
  scene.image = image;
  scene.centerline = &seen.centerline;
  scene.trees = {{view.T_camera_model, {}, kStartColor, "registered in this view alone"},
                 {jointPose(result, view), {}, kConvergedColor, "by all views together"}};
  scene.caption = view.name;
  if (const AnatomyViewFit* fit = fitOf(result, view.name)) {
    if (fit->outlier) scene.trees.back().color_bgr = kRejectedColor;
    scene.caption += formatted(": %.2f deg, %.1f mm apart", radToDeg(fit->rotation_rad), 1e3 * fit->translation_m);
    if (fit->outlier) scene.caption += " - OUTLIER, left out";
  }
  return drawOverlay(scene, tree, seen.camera);
}

cv::Mat anatomyResiduals(const AnatomyResult& result) {
  BarChart turns{"Turn between a view's own registration and all views' [deg]", "deg"},
      places{"The same of its place, at the model's centre [mm]", "mm"};
  for (const AnatomyViewFit& view : result.views) {
    turns.add(view.name, radToDeg(view.rotation_rad), view.outlier);
    places.add(view.name, 1e3 * view.translation_m, view.outlier);
  }
  return drawPlots({turns.plot, places.plot}, 720, 270);
}

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_pictures.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <opencv2/core.hpp>

#include "angio/base/formatted.hpp"
#include "angio/evaluation/overlay.hpp"
#include "bar_chart.hpp"

namespace angio::calibration {
namespace {

constexpr int kMain = 1;  // Vermilion.

// Equal areas, z towards the reader; of an axis' two ends the one in front. Source: Lambert's azimuthal projection.
Eigen::Vector2d onDisc(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d front = axis.z() < 0 ? Eigen::Vector3d(-axis) : axis;
  return front.head<2>() / std::sqrt(1 + front.z());
}

cv::Mat ellipsoidBars(const std::string& title, const std::string& unit, const Eigen::Matrix3d& covariance,
                      double per_unit, int color) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  BarChart bars{title, unit, color};
  for (int k = 2; k >= 0; --k) {
    const Eigen::Vector3d axis = withPositiveLargest(solver.eigenvectors().col(k));
    bars.add(formatted("%.2f %.2f %.2f", axis.x(), axis.y(), axis.z()),
             per_unit * std::sqrt(std::max(0.0, solver.eigenvalues()[k])), false);
  }
  return drawPlots({bars.plot}, 520, 270);
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

}  // namespace angio::calibration

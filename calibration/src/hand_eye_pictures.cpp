// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_pictures.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <opencv2/core.hpp>

#include "angio/base/formatted.hpp"
#include "chart.hpp"

namespace angio {
namespace {

const cv::Scalar kSphere(205, 205, 205), kMain(0, 94, 213);

// Equal areas, z towards the reader; of an axis' two ends the one in front. Source: Lambert's azimuthal projection.
Eigen::Vector2d onDisc(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d front = axis.z() < 0 ? Eigen::Vector3d(-axis) : axis;
  return front.head<2>() / std::sqrt(1 + front.z());
}

std::vector<Bar> ellipsoidBars(const Eigen::Matrix3d& covariance, double per_unit, const cv::Scalar& colour) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  std::vector<Bar> bars;
  for (int k = 2; k >= 0; --k) {
    Eigen::Vector3d axis = solver.eigenvectors().col(k);
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    if (axis[largest] < 0) axis = -axis;
    bars.push_back({formatted("%.2f %.2f %.2f", axis.x(), axis.y(), axis.z()),
                    per_unit * std::sqrt(std::max(0.0, solver.eigenvalues()[k])), colour});
  }
  return bars;
}

}  // namespace

cv::Mat poseResiduals(const HandEyeResult& result) {
  std::vector<Bar> turns, places;
  for (const HandEyePoseFit& pose : result.poses) {
    const cv::Scalar colour = pose.outlier ? kChartLeftOut : kChartGood;
    turns.push_back({pose.name, radToDeg(pose.rotation_rad), colour});
    places.push_back({pose.name, 1e3 * pose.translation_m, colour});
  }
  const int outliers = result.outliers();
  const std::string left_out = outliers == 0 ? "" : formatted("; %d left out (red)", outliers);
  return stacked(
      {barChart(formatted("Turn of each pose, rms %.3f deg", radToDeg(result.residuals.rotation_rad)) + left_out, "deg",
                turns),
       barChart(formatted("Place of each pose, rms %.3f mm", 1e3 * result.residuals.translation_m) + left_out, "mm",
                places)});
}

cv::Mat turnAxes(const PoseSet& set) {
  const HandEyeEquations equations = handEyeEquations(set);
  const MotionSpread spread = motionSpread(equations);
  Chart chart = Chart::ofEqualScale(
      formatted("Turns, rms: %.1f deg about the main axis, %.1f across", radToDeg(spread.along_rad),
                radToDeg(spread.across_rad)),
      {set.setup == HandEyeSetup::kEyeInHand ? "x of the hand" : "x of the base", -1.15, 1.15, false},
      {"", -1.15, 1.15, false}, {560, 540});
  constexpr int kSteps = 90;
  for (const double from_z_deg : {30.0, 60.0, 90.0}) {
    const double radius = std::sqrt(2.0) * std::sin(0.5 * degToRad(from_z_deg));
    for (int i = 0; i < kSteps; ++i) {
      const auto at = [&](int step) {
        const double angle = 2 * kPi * step / kSteps;
        return Eigen::Vector2d(radius * std::cos(angle), radius * std::sin(angle));
      };
      chart.line(at(i), at(i + 1), kSphere, from_z_deg == 90 ? 2 : 1);
    }
  }
  chart.line({-1, 0}, {1, 0}, kSphere, 1);
  chart.line({0, -1}, {0, 1}, kSphere, 1);
  chart.text("x", {1, 0}, kChartInk);
  chart.text("y", {0, 1}, kChartInk, {-4, -8});
  chart.text("z", {0, 0}, kChartInk);
  for (std::size_t i = 0; i < equations.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const Eigen::Vector3d turn = logSO3(equations.hands[k].linear().transpose() * equations.hands[i].linear());
      const double angle = turn.norm();
      if (angle < 1e-6) continue;
      const double radius_px = 1 + 5 * std::sqrt(angle / std::max(spread.largest_turn_rad, angle));
      chart.disc(onDisc(turn / angle), radius_px, kChartGood);
    }
  }
  chart.ring(onDisc(spread.main_axis), 11, kMain);
  chart.text("main axis", onDisc(spread.main_axis), kMain, {-30, -16});
  return chart.picture();
}

cv::Mat covarianceBars(const PoseSet& set, const HandEyeResult& result) {
  const auto [X, Z] = transformNames(set.setup);
  std::vector<std::string> names{Z};
  if (result.covariance.rows() == 12) names.insert(names.begin(), X);
  std::vector<cv::Mat> rows;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(6 * k);
    cv::Mat row;
    constexpr int kWidth_px = 460;
    cv::hconcat(barChart(names[k] + ": place, sigma", "mm",
                         ellipsoidBars(result.covariance.block<3, 3>(at, at), 1e3, kChartGood), {kWidth_px, 270}),
                barChart(names[k] + ": turn, sigma", "deg",
                         ellipsoidBars(result.covariance.block<3, 3>(at + 3, at + 3), radToDeg(1), kChartHeldOut),
                         {kWidth_px, 270}),
                row);
    rows.push_back(row);
  }
  return stacked(rows);
}

}  // namespace angio

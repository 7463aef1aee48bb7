// SPDX-License-Identifier: GPL-2.0-or-later
#include "view_map_picture.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "angio/evaluation/overlay.hpp"
#include "angio/evaluation/plot.hpp"
#include "angio/servo/desired_view.hpp"

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

}  // namespace

std::string inWords(const ViewAngles& angles) {
  const double primary_deg = radToDeg(angles.primary_rad), secondary_deg = radToDeg(angles.secondary_rad);
  return formatted("%s %.1f, %s %.1f", primary_deg < 0 ? "RAO" : "LAO", std::abs(primary_deg),
                   secondary_deg < 0 ? "CAU" : "CRA", std::abs(secondary_deg));
}

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

}  // namespace angio::apps

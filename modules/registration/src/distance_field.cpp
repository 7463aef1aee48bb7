// SPDX-License-Identifier: GPL-2.0-or-later
#include "distance_field.hpp"

#include <ceres/cubic_interpolation.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace angio::registration {
namespace {

// Cells along the detector's longer side: 2 px a cell for 1024 px. The transform's time goes with the square.
constexpr double kCellsAcross = 512;
// The grid goes on beyond the detector by this share of its longer side: most of a tree that a start puts there lies
// nearer.
constexpr double kBorderShare = 0.0625;
// Cells nearer than this to a segment are exact: all that bicubic interpolation reads within a cell of the centreline.
constexpr int kExactCells = 4;

}  // namespace

double DistanceField::Segment::squaredDistance(const Eigen::Vector2d& cell) const {
  const Eigen::Vector2d from_a = cell - a;
  const double along = std::clamp(from_a.dot(to_b) * inverse_length2, 0.0, 1.0);
  return (from_a - along * to_b).squaredNorm();
}

std::vector<DistanceField::Segment> DistanceField::segmentsOf(const Centerline2d& centerline) const {
  const Eigen::Matrix2Xd& points = centerline.points_px;
  std::vector<Segment> segments;
  segments.reserve(static_cast<std::size_t>(points.cols()));
  bool joined = false;  // To the point before.
  for (int i = 0; i < centerline.size(); ++i) {
    const bool joins = centerline.ordered() && i + 1 < centerline.size() &&
                       centerline.branch[i + 1] == centerline.branch[i] &&
                       (points.col(i + 1) - points.col(i)).norm() <= kMaxStep_px;
    if (joins || !joined) {
      const Eigen::Vector2d to_next =
          joins ? Eigen::Vector2d(points.col(i + 1) - points.col(i)) : Eigen::Vector2d(0, 0);
      const Eigen::Vector2d to_b = to_next / step_px_;
      const double length2 = to_b.squaredNorm();
      segments.push_back({(points.col(i) - origin_px_) / step_px_, to_b, length2 > 0 ? 1 / length2 : 0});
    }
    joined = joins;
  }
  return segments;
}

DistanceField::DistanceField(const Centerline2d& centerline, const XrayCamera& camera) {
  const double side_px = std::max(camera.width_px(), camera.height_px()), border_px = kBorderShare * side_px;
  step_px_ = side_px / kCellsAcross;
  origin_px_.setConstant(-border_px);
  rows_ = static_cast<int>(std::ceil((camera.height_px() + 2 * border_px) / step_px_)) + 1;
  columns_ = static_cast<int>(std::ceil((camera.width_px() + 2 * border_px) / step_px_)) + 1;

  const std::vector<Segment> segments = segmentsOf(centerline);
  cv::Mat free(rows_, columns_, CV_8UC1, cv::Scalar(255)), cells;
  for (const Segment& segment : segments) draw(segment, free);
  if (cv::countNonZero(free) == rows_ * columns_) return;
  cv::distanceTransform(free, cells, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  squared_px2_ = cells.mul(cells, step_px_ * step_px_);
  // What the drawn lines say of the cells beside them goes first: it may be too little.
  for (const Segment& segment : segments) {
    visitAround(segment, [](double, float& cell) { cell = std::numeric_limits<float>::max(); });
  }
  for (const Segment& segment : segments) {
    visitAround(segment,
                [](double squared_px2, float& cell) { cell = std::min(cell, static_cast<float>(squared_px2)); });
  }
}

void DistanceField::draw(const Segment& segment, cv::Mat& free) const {
  // Half a cell a step: no cell that the line passes through for more than a corner is left out.
  const int steps = static_cast<int>(2 * segment.to_b.norm()) + 1;
  for (int k = 0; k <= steps; ++k) {
    const Eigen::Vector2d cell = segment.a + static_cast<double>(k) / steps * segment.to_b;
    // In floating point: a place far off the detector is no integer.
    if (!(cell.x() > -0.5 && cell.y() > -0.5 && cell.x() < columns_ - 0.5 && cell.y() < rows_ - 0.5)) continue;
    free.at<uchar>(static_cast<int>(std::lround(cell.y())), static_cast<int>(std::lround(cell.x()))) = 0;
  }
}

template <typename Visit>
void DistanceField::visitAround(const Segment& segment, const Visit& visit) {
  const auto range = [](double from, double by, int size) {
    const double low = std::min(from, from + by) - kExactCells, high = std::max(from, from + by) + kExactCells;
    return std::pair(static_cast<int>(std::ceil(std::clamp(low, 0.0, static_cast<double>(size)))),
                     static_cast<int>(std::floor(std::clamp(high, -1.0, size - 1.0))));
  };
  const auto [first_row, last_row] = range(segment.a.y(), segment.to_b.y(), rows_);
  const auto [first_column, last_column] = range(segment.a.x(), segment.to_b.x(), columns_);
  for (int row = first_row; row <= last_row; ++row) {
    for (int column = first_column; column <= last_column; ++column) {
      const double squared = segment.squaredDistance(Eigen::Vector2d(column, row));
      if (squared <= kExactCells * kExactCells) visit(step_px_ * step_px_ * squared, squared_px2_(row, column));
    }
  }
}

DistanceField::Sample DistanceField::at(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d wanted = (pixel - origin_px_) / step_px_;
  const Eigen::Vector2d cell(std::clamp(wanted.x(), 0.0, columns_ - 1.0), std::clamp(wanted.y(), 0.0, rows_ - 1.0));
  Sample sample;
  double along_row = 0, along_column = 0;
  using Grid = ceres::Grid2D<float>;
  const Grid grid(squared_px2_[0], 0, rows_, 0, columns_);
  ceres::BiCubicInterpolator<Grid>(grid).Evaluate(cell.y(), cell.x(), &sample.squared_px2, &along_row, &along_column);
  sample.gradient_px = Eigen::Vector2d(along_column, along_row) / step_px_;
  // Between vessels that are nearer to each other than a few cells the cubic may swing below zero.
  if (sample.squared_px2 <= 0) return {};
  const Eigen::Vector2d beyond = step_px_ * (wanted - cell);
  const double beyond_px = beyond.norm();
  if (beyond_px == 0) return sample;
  const double border_px = std::sqrt(sample.squared_px2), distance_px = border_px + beyond_px;
  // Along the border its own distance changes; across it the way back does.
  Eigen::Vector2d slope = sample.gradient_px / (2 * border_px);
  for (int k = 0; k < 2; ++k) {
    if (beyond[k] != 0) slope[k] = 0;
  }
  return {distance_px * distance_px, 2 * distance_px * (slope + beyond / beyond_px)};
}

}  // namespace angio::registration

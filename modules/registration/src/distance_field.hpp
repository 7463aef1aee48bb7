// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::registration {

/// The distance transform of a 2D centreline: how far from it a pixel position lies, anywhere in the image plane.
///
/// A regular grid over the detector and a border holds *squared* distances, which are smooth where the distance itself
/// has its kink, on the centreline: bicubic interpolation of them is exact beside a straight vessel. Cells beside the
/// centreline hold the exact distance from its lines, so that the grid's step does not round them. Cells further away
/// hold what OpenCV's transform of the drawn lines says, which is off by less than a cell.
class DistanceField {
 public:
  /// Branches are polylines; points without a branch, and gaps of more than kMaxStep_px, are not joined.
  DistanceField(const Centerline2d& centerline, const XrayCamera& camera);

  /// Whether no part of the centreline lies on the grid: then there is no distance to ask for.
  bool empty() const { return squared_px2_.empty(); }

  struct Sample {
    double squared_px2 = 0;
    Eigen::Vector2d gradient_px{0, 0};  ///< Of the squared distance.
  };

  /// The squared distance of a pixel position and its gradient. Beyond the border the way back to it is added to the
  /// distance that the border has.
  Sample at(const Eigen::Vector2d& pixel) const;

 private:
  // A line between two points, or one point, in cells.
  struct Segment {
    Eigen::Vector2d a, to_b;
    double inverse_length2;  // 0 for a single point.

    double squaredDistance(const Eigen::Vector2d& cell) const;
  };

  std::vector<Segment> segmentsOf(const Centerline2d& centerline) const;
  // Marks the cells that the segment passes through.
  void draw(const Segment& segment, cv::Mat& free) const;
  // Calls visit(squared distance, the cell's value) for the cells near the segment.
  template <typename Visit>
  void visitAround(const Segment& segment, const Visit& visit);

  double step_px_;
  Eigen::Vector2d origin_px_;  // Pixel position of cell (0, 0).
  int rows_, columns_;
  cv::Mat_<float> squared_px2_;
};

}  // namespace angio::registration

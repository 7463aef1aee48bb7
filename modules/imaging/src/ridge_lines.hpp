// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <vector>

#include "centre_lines.hpp"
#include "ridge_scales.hpp"
#include "tracks.hpp"
#include "tube_templates.hpp"

namespace angio {

/// Fits tubes along the branches of a graph: moves lines onto the vessels' middles, measures them.
class RidgeFitting {
 public:
  RidgeFitting(float largest_radius, const RidgeScales& scales);

  /// The graph's live branches, each as one line; free ends, junctions and crossings stay where they are in the graph.
  std::vector<CentreLine> operator()(const SkeletonGraph& graph, const RidgeScales& scales) const;

 private:
  struct Point {
    float offset = 0, radius = 1, sigma = 0, contrast = 0, misfit = 0, bias = 0;
    bool valid = false;
  };

  Point fitAt(const RidgeScales& scales, const cv::Point2f& p, const cv::Point2f& along, float radius) const;
  std::vector<Point> fitAlong(const SkeletonGraph& graph, const RidgeScales& scales, Track& track) const;
  static void trim(Track& track, std::vector<Point>& points);
  void recentre(Track& track, std::vector<Point>& points, float filter) const;
  CentreLine finished(const SkeletonGraph& graph, const Track& track, const std::vector<Point>& points) const;

  TubeTemplates templates_;
  float largest_ = 20;
};

}  // namespace angio

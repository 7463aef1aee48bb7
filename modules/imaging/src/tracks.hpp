// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "skeleton_graph.hpp"

namespace angio::imaging {

using Polyline = std::vector<cv::Point2f>;

/// Mean of neighbouring points, weighted by a normal distribution of `sigma` points. The ends of an open line stay
/// where they are, for it is continued by its point reflection there; a closed one has no ends.
Polyline smoothed(const Polyline& line, float sigma, bool closed);

/// Places on the line at equal steps of about `spacing`, both ends included: index and fraction in one number.
std::vector<float> equalSteps(const Polyline& line, float spacing);

/// The line at such a place.
cv::Point2f at(const Polyline& line, float place);

/// The direction of the line at point i, over `reach` points to both sides where they exist. Length one, or zero.
cv::Point2f directionAt(const Polyline& line, std::size_t i, std::size_t reach);

/// One branch on its way from pixels to a centre line.
struct Track {
  Polyline line;
  std::vector<float> radius;
  int begin = -1, end = -1;  ///< Nodes of the graph, -1 at a free end.
  bool closed = false, expected = false;
  int branch = -1;  ///< Of the graph.

  /// Points at each end whose place says more of the junction there than of the branch.
  std::size_t begin_reach = 0, end_reach = 0;
};

/// A branch with its nodes' positions, smoothed over `sigma` points and with points one pixel apart.
Track trackOf(const SkeletonGraph& graph, const SkeletonGraph::Branch& branch, float sigma);

/// How far the vessels at a node reach into a line of `size` points that ends there [points].
std::size_t reachOf(const SkeletonGraph& graph, int node, std::size_t size);

/// Brings the ends of all tracks at a node to the point that is nearest to their extensions; where another track passes
/// through, an end goes on straight to it.
void meet(const SkeletonGraph& graph, std::vector<Track>& tracks);

}  // namespace angio::imaging

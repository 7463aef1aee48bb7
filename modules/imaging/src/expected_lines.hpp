// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/vessel/centerline2d.hpp"
#include "centre_lines.hpp"
#include "flatten.hpp"
#include "skeleton_graph.hpp"
#include "tracks.hpp"

namespace angio::imaging {

/// Where vessels are expected, by what is known of the tree and its pose. What is seen without that knowledge says
/// where they are indeed; what is not seen can then be looked at there.
class ExpectedLines {
 public:
  /// @param expected  The projected tree, in branches [px of the image].
  ExpectedLines(const Centerline2d& expected, const WorkingGrid& grid);

  /// Moves the lines by the affine map that brings them nearest to the graph's branches, across these and robustly, and
  /// adds what no branch runs along then to the graph, as branches with free ends that are `expected`. Without enough
  /// branches beside them, or where the map would move a place by more than 10 working pixels, the lines stay where
  /// they are.
  void addTo(SkeletonGraph& graph);

  /// Marks the lines most of which run along an expected one.
  void markIn(std::vector<CentreLine>& lines) const;

 private:
  cv::Rect2f within_;
  std::vector<Polyline> lines_;  // Points a working pixel apart.
};

}  // namespace angio::imaging

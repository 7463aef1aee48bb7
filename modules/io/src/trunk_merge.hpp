// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "tree_formats.hpp"

namespace angio::io {

/// Of one file. Branches of a vessel tree are some hundreds; comparing their beginnings is quadratic in their number.
constexpr int kMaxVtkLines = 10'000;

/// Grows a tree from lines that all run from a source to an outlet, so that each repeats the trunk before it.
///
/// The beginning of a line that follows the tree grown so far within a tenth of the vessel's radius (and at least 0.1
/// mm) is dropped, and the rest becomes a branch: VMTK's lines are the same to the last digit in the trunk, but drift
/// apart before a bifurcation and may have been resampled. A line that begins at a point of the tree is its branch; one
/// that begins elsewhere begins a tree of its own.
class TrunkMerge {
 public:
  void addLine(const std::vector<Eigen::Vector3d>& points_mm, const std::vector<std::optional<double>>& radii_mm);

  /// Ids are the points' numbers, parents first.
  const std::vector<TreeRow>& rows() const { return rows_; }

 private:
  struct Place {
    int from;     // The line is on the edge behind this point, or at it.
    int nearest;  // Where a branch would begin.
  };

  std::optional<Place> follow(int from, const Eigen::Vector3d& point_mm, double step_mm) const;
  std::optional<Place> startAt(const Eigen::Vector3d& point_mm) const;
  double tolerance(int i) const;
  void append(int parent, const Eigen::Vector3d& point_mm, std::optional<double> radius_mm);

  std::vector<TreeRow> rows_;
  std::vector<std::vector<int>> children_;
  std::vector<int> roots_;
  std::map<Position, int> point_at_;
};

}  // namespace angio::io

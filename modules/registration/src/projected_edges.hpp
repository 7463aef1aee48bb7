// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/registration/xray_view.hpp"
#include "kernel_field.hpp"

namespace angio::registration {

/// Of each entry, cell by cell and padded for the widest vectors: where its edge begins, how it goes, one over its
/// length squared, and twice its angle.
struct EdgeEntries {
  std::vector<float> u, v, du, dv, inverse_length2, cos2, sin2;
  std::vector<int> edge;
  void resize(std::size_t size);
};

/// What the vector code finds: which entry, where on it, and how far away [px^2].
struct FoundEntry {
  int entry;
  float along, distance2;
};

/// The model as lines in one view: its edges that are in front of the source, projected, in a grid of cells.
///
/// Memory is kept between uses.
class ProjectedEdges {
 public:
  /// @param edges  Pairs of columns of `points_centred`.
  void project(const Eigen::Matrix3Xd& points_centered, const std::vector<std::pair<int, int>>& edges,
               const XrayCamera& camera, const Pose& T_view_centered);

  struct Nearest {
    int edge = -1;                     ///< Index into the edges, or -1: none within the gate.
    float along = 0;                   ///< Where on it, 0 to 1.
    float normal_u = 0, normal_v = 0;  ///< Unit, across the edge.
    float distance2_px2 = 0;           ///< To the edge itself: larger beyond its ends.
    float offset_px = 0;               ///< Of the point from the edge's line, along the normal.
  };

  /// The nearest edge within `gate_px` that runs along the direction (cosine of twice the angle between at least
  /// `min_cos2`; edges seen end-on have no direction and do not match).
  Nearest nearest(float u, float v, float cos2, float sin2, float gate_px, float min_cos2) const;

  /// The same for each point of an image, into `nearest`: the vector routine is chosen once for all. Returns how many
  /// have one.
  int nearestOfEach(const OrientedPoints& image, float gate_px, float min_cos2, std::vector<Nearest>& nearest) const;

  /// Projected length of all edges on the detector [px].
  double length_px() const { return length_px_; }

 private:
  using NearestEntry = void(const EdgeEntries&, const int* ranges, int range_count, float u, float v, float cos2,
                            float sin2, float min_cos2, FoundEntry&);
  Nearest nearestWith(NearestEntry* nearest_entry, float u, float v, float cos2, float sin2, float gate_px,
                      float min_cos2) const;

  std::vector<float> u_, v_;
  std::vector<char> in_front_;
  EdgeEntries entries_;
  std::vector<std::pair<int, int>> placed_;  // Cell and edge.
  std::vector<int> cell_begin_;
  int columns_ = 0, rows_ = 0;
  double length_px_ = 0;
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/registration/xray_view.hpp"
#include "kernel_field.hpp"

namespace angio {

struct RawEntries;
struct RawNearest;

/// The model as lines in one view: its edges that are in front of the source, projected, in a grid of cells.
///
/// Memory is kept between uses.
class ProjectedEdges {
 public:
  /// @param edges  Pairs of columns of `points_centred`.
  void project(const Eigen::Matrix3Xd& points_centred, const std::vector<std::pair<int, int>>& edges,
               const XrayCamera& camera, const Pose& T_view_centred);

  struct Nearest {
    int edge = -1;                     ///< Index into the edges, or -1: none within the gate.
    float along = 0;                   ///< Where on it, 0 to 1.
    float normal_u = 0, normal_v = 0;  ///< Unit, across the edge.
    float distance2_px2 = 0;           ///< To the edge itself: larger beyond its ends.
  };

  /// The nearest edge within `gate_px` that runs along the direction (cosine of twice the angle between at least
  /// `least_cos2`; edges seen end-on have no direction and do not match).
  Nearest nearest(float u, float v, float cos2, float sin2, float gate_px, float least_cos2) const;

  using NearestEntry = void(const RawEntries&, const int* ranges, int range_count, float u, float v, float cos2,
                            float sin2, float least_cos2, RawNearest&);
  /// The same with a vector routine that has been chosen once for many.
  Nearest nearestWith(NearestEntry* nearest_entry, float u, float v, float cos2, float sin2, float gate_px,
                      float least_cos2) const;

  const std::vector<float>& u() const { return u_; }
  const std::vector<float>& v() const { return v_; }
  const std::vector<char>& inFront() const { return in_front_; }
  /// Projected length of all edges on the detector [px].
  double length_px() const { return length_px_; }

 private:
  // Of each entry, cell by cell and padded for the widest vectors: where its edge begins, how it goes, one over its
  // length squared, and twice its angle.
  struct Entries {
    std::vector<float> u, v, du, dv, inverse_length2, cos2, sin2;
    std::vector<int> edge;
    void resize(std::size_t size);
  };
  std::vector<float> u_, v_;
  std::vector<char> in_front_;
  Entries entries_;
  std::vector<std::pair<int, int>> placed_;  // Cell and edge.
  std::vector<int> cell_begin_;
  int columns_ = 0, rows_ = 0;
  double length_px_ = 0;
};

/// Matches of one view: which image points lie on which model edge.
struct LineMatches {
  std::vector<ProjectedEdges::Nearest> of_point;  ///< One per image point.
  int matched = 0;

  // For the equations, one array a quantity, padded: the matched place on the model (about the centroid), the normal
  // (zero where there is no match), and the square root of the weight times the residual of the last equations.
  std::vector<float> x, y, z, normal_u, normal_v, weighted_residual;
};

void matchLines(const OrientedPoints& image, const ProjectedEdges& edges, double gate_px, double least_cos2,
                LineMatches& matches);

/// Normal equations of sum_j w(r_j) r_j^2, r_j the distance of image point j from its edge's line [px], for T exp(dx).
struct LineSums {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();  ///< Half the gradient of the sum: the step is -(H + prior)^-1 (g + prior).
  double weight = 0;              ///< Sum of w(r_j).
  double squares_px2 = 0;         ///< Sum of w(r_j) r_j^2.

  /// Sum of w r w' r' over pairs of matched points that are 1, 2, 4, 8 ... apart in a row.
  static constexpr int kLags = 7;
  std::array<double, kLags> lagged_px2 = {};

  /// How many neighbours say the same, on average: 1 + 2 sum of the residuals' autocorrelation; 1 when they are
  /// independent.
  double togetherness(int points) const;
};

/// Puts the matched places on the model into the arrays that addLineEquations reads. `points_centred` are the points
/// that were projected, or displaced ones.
void resolveMatches(const Eigen::Matrix3Xd& points_centred, const std::vector<std::pair<int, int>>& edges,
                    LineMatches& matches);

/// Adds one view. `tolerance_px` is the scale of the Gaussian weight w(r) = exp(-r^2 / 2 tolerance^2). In single
/// precision: a ten-thousandth of a pixel. The arrays of `image` are padded (OrientedPoints::pad).
void addLineEquations(const OrientedPoints& image, LineMatches& matches, const XrayCamera& camera,
                      const Pose& T_view_centred, double tolerance_px, LineSums& sums);

}  // namespace angio

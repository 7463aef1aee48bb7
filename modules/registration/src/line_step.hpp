// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "projected_edges.hpp"

namespace angio::registration {

/// Matches run the same way to within 30 deg: cosine squared.
inline constexpr double kMinCos2 = 0.5;

/// Matches of one view: which image points lie on which model edge.
struct LineMatches {
  std::vector<ProjectedEdges::Nearest> of_point;  ///< One per image point.
  int matched = 0;

  // For the equations, one array a quantity, padded: the matched place on the model (about the centroid), the normal
  // (zero where there is no match), and the square root of the weight times the residual of the last equations.
  std::vector<float> x, y, z, normal_u, normal_v, weighted_residual;
};

/// Matches every image point. Normals are lengthened by the point's certainty, and with them every residual: what is
/// counted in the sums is pixels of a point of middling certainty.
void matchLines(const OrientedPoints& image, const ProjectedEdges& edges, double gate_px, double min_cos2,
                LineMatches& matches);

/// Makes points count little that may show two vessels as one: where a second edge runs alike within the vessel's
/// radius or so, the image's line lies somewhere between both, and pulls either one to where it is not. Images without
/// radii are left as they are.
void softenShared(const OrientedPoints& image, const ProjectedEdges& edges, double min_cos2, LineMatches& matches);

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

/// The standard deviation behind a weighted mean square of residuals: a Gaussian weight of width `tau` hides a part of
/// it. At most sqrt(10) tau.
double noiseBehind(double weighted_square, double tau);

/// Puts the matched places on the model into the arrays that addLineEquations reads. `points_centred` are the points
/// that were projected, or displaced ones.
void resolveMatches(const Eigen::Matrix3Xd& points_centered, const std::vector<std::pair<int, int>>& edges,
                    LineMatches& matches);

/// Adds one view. `tolerance_px` is the scale of the Gaussian weight w(r) = exp(-r^2 / 2 tolerance^2). In single
/// precision: a ten-thousandth of a pixel. The arrays of `image` are padded (OrientedPoints::pad).
void addLineEquations(const OrientedPoints& image, LineMatches& matches, const XrayCamera& camera,
                      const Pose& T_view_centered, double tolerance_px, LineSums& sums);

}  // namespace angio::registration

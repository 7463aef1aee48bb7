// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/registration/iterative_pnp_settings.hpp"
#include "point_matcher.hpp"

namespace angio::registration {

/// For each model point where the image pulls it, and how strongly: Delta(i) and w_ij of the paper's eq. 5, summed over
/// j. For fixed weights sum_j w_ij |u - q_j|^2 = weight |u - target|^2 + constant, so one target and one weight say it
/// all.
struct Pull {
  Eigen::Matrix2Xd target_px;                ///< 2 x N.
  Eigen::ArrayXd weight;                     ///< N; 0 for a point without a match.
  std::vector<int> nearest;                  ///< N, nearest image point, or -1; kept between iterations.
  std::vector<PointMatcher::Nearby> nearby;  ///< N, what the last search of each point left.
  double max_distance_px = 0;                ///< Over all matched points.
  double weighted_squares_px2 = 0;           ///< Sum of weight * squared distance to the nearest point.

  explicit Pull(int size)
      : target_px(Eigen::Matrix2Xd::Zero(2, size)),
        weight(Eigen::ArrayXd::Zero(size)),
        nearest(size, -1),
        nearby(size) {}
};

/// Which model points have a pixel, and may pull.
struct Projected {
  Eigen::Matrix2Xd pixel;      ///< 2 x N.
  std::vector<char> may_pull;  ///< N.

  explicit Projected(int size) : pixel(Eigen::Matrix2Xd::Zero(2, size)), may_pull(size, 0) {}
};

/// Matches every projected point with the image (fills nearest, target and largest distance; weights are set to 1). An
/// image without points matches none.
void matchNearest(const Projected& projected, const PointMatcher& image, Pull& pull);

/// Sets weights and targets for the kernel at scale l [px]. `branch` are the image points' branches, or empty: then
/// Delta(i) is the nearest point alone.
void weigh(const Projected& projected, const PointMatcher& image, const std::vector<int>& branch,
           const IterativePnpSettings& settings, double scale_px, Pull& pull);

}  // namespace angio::registration

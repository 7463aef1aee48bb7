// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/registration/xray_view.hpp"
#include "point_matcher.hpp"
#include "pose_prior_term.hpp"

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

/// Projects centred points into a view; those behind the source, and those that it does not see when asked, do not
/// pull.
void projectPoints(const Eigen::Matrix3Xd& points_centered, const XrayView& view, const Pose& T_camera_centered,
                   OutsideImage outside, Projected& projected);

/// The normal equations of one IRLS problem over all views v, with one pull for each:
/// sum_v sum_i weight_vi |pi_v(T_v_first T exp(dx) p_i) - target_vi|^2 + prior.
struct NormalEquations {
  Matrix6d H_data = Matrix6d::Zero();
  Matrix6d H = Matrix6d::Zero();  ///< Data and prior.
  Vector6d g = Vector6d::Zero();  ///< Half the gradient.
  double cost_px2 = 0;
};
NormalEquations normalEquations(const Eigen::Matrix3Xd& points_centered, const XrayViews& views,
                                const Pose& T_camera_centered, const std::vector<Pull>& pulls,
                                const PosePriorTerm& prior);

/// Cost of the same problem at a pose.
double irlsCost(const Eigen::Matrix3Xd& points_centered, const XrayViews& views, const Pose& T_camera_centered,
                const std::vector<Pull>& pulls, const PosePriorTerm& prior);

/// Levenberg and Marquardt's damping, relative to the system's diagonal: less after a step that lowers the cost, more
/// until one does.
class Damping {
 public:
  /// @param lowers  Takes a damping, and says whether the step with it is one and does not raise the cost.
  /// Returns whether a step was found, within a few tries.
  template <typename Try>
  bool step(const Try& lowers) {
    for (int attempt = 0; attempt < 6; ++attempt) {
      if (lowers(value_)) {
        value_ = std::max(1e-9, value_ / 5);
        return true;
      }
      value_ = std::min(1e6, value_ * 10);
    }
    return false;
  }

 private:
  double value_ = 1e-4;
};

/// Levenberg-Marquardt on SE(3), one step at a time, T <- T exp(dx) about the tree's centroid (paper, section III-D).
class LevenbergMarquardt {
 public:
  struct Step {
    Pose T_camera_centered;
    Twist dx = Twist::Zero();
    bool lowered = false;  ///< Whether the cost went down; otherwise the pose is the old one.
  };
  Step step(const Eigen::Matrix3Xd& points_centered, const XrayViews& views, const Pose& T_camera_centered,
            const std::vector<Pull>& pulls, const PosePriorTerm& prior);

 private:
  Damping damping_;  // Relative, so that metres and radians are damped alike.
};

}  // namespace angio::registration

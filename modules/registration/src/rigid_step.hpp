// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/registration/xray_view.hpp"
#include "irls.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

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
  double damping_ = 1e-4;  // Relative to the Hessian's diagonal, so that metres and radians are damped alike.
};

}  // namespace angio::registration

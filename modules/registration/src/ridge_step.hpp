// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/registration/xray_view.hpp"
#include "pose_prior_term.hpp"
#include "ridge_image.hpp"
#include "rigid_step.hpp"

namespace angio::registration {

/// The points of a model and what each of them counts.
struct WeightedPoints {
  Eigen::Matrix3Xd centered;  ///< 3 x N [m], about the tree's centroid.
  Eigen::ArrayXd weight;      ///< N, mean 1.
};

/// NICP's weight of a point of a tube by its radius, 2 / (1 + exp(-2 r)) with r in millimetres: from 1 for the thinnest
/// tubes to 2 for thick ones (Aylward et al. 2003, as ITK's ImageToTubeRigidMetric has it). A tree's points without a
/// radius have 1. Divided by their mean.
WeightedPoints weightedPoints(const VesselTree& tree);

/// What NICP maximises: the weighted mean of the blurred images at the projected points,
/// sum_v sum_i w_i I_v(pi_v(T_v_first T p_i)) / sum_v sum_i w_i.
///
/// A point that has no pixel, or one that its view does not see, adds nothing to the numerator and stays in the
/// denominator. So a pose gains nothing by moving the tree out of view.
double ridgeMetric(const WeightedPoints& points, const XrayViews& views, const std::vector<const RidgeImage*>& images,
                   const Pose& T_camera_centered);

/// The same as a cost to be minimised, in the unit of a sum of squared distances, and a prior added to it:
/// 2 s^2 sum_v sum_i w_i (1 - I_v) + prior, s the blur's standard deviation [px]. Near a line that is alone a point's
/// share is w_i times its squared distance. Without a prior it falls when the metric rises, and only then.
double ridgeCost(const WeightedPoints& points, const XrayViews& views, const std::vector<const RidgeImage*>& images,
                 const Pose& T_camera_centered, const PosePriorTerm& prior);

/// Cost, half its gradient with respect to T exp(dx), and a matrix in place of half its Hessian that is not negative.
///
/// Of every point's curvature of the image the absolute value is taken, no more than the value over s^2, which is what
/// a Gaussian kernel has at its middle, and no less than a tenth of it. The curvature of the projection is left out.
struct RidgeEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();
  double cost_px2 = 0;
};
RidgeEquations ridgeEquations(const WeightedPoints& points, const XrayViews& views,
                              const std::vector<const RidgeImage*>& images, const Pose& T_camera_centered,
                              const PosePriorTerm& prior);

/// What of the pose may move.
enum class RidgeFreedom {
  kAll,
  kInPlane,  ///< Translation across the first view's axis, and rotation about it.
};

/// Damped Newton on SE(3) of one scale, one step at a time, T <- T exp(dx) about the tree's centroid. The cost never
/// rises.
class RidgeAscent {
 public:
  LevenbergMarquardt::Step step(const WeightedPoints& points, const XrayViews& views,
                                const std::vector<const RidgeImage*>& images, const Pose& T_camera_centered,
                                const PosePriorTerm& prior, RidgeFreedom freedom = RidgeFreedom::kAll);

 private:
  Damping damping_;
};

}  // namespace angio::registration

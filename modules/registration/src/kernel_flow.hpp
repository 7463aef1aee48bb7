// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "kernel_pairs.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// Returns the smallest root in (0, max] of the derivative c1 + 2 c2 t + 3 c3 t^2 + 4 c4 t^3 of a polynomial without
/// constant term, c1 > 0; or `max` where it rises all the way.
double firstPeak(const std::array<double, 4>& coefficients, double max);

/// The gradient flow of CVO on SE(3), one step at a time, T <- T exp(t xi) about the tree's centroid.
///
/// The objective is l^2 (2 <f, g> - <f, f>) less the prior's cost [px^2], with the functions f of the projected model
/// and g of the image, views added up. It is -|f - g|^2 but for what does not depend on the pose. The source moves
/// points by isometries, under which |f| is constant, and so keeps <f, g> alone; a projection is no isometry. With
/// CvoObjective::kInnerProduct the objective is 2 l^2 <f, g> less the prior's cost.
///
/// The direction xi of the flow is the gradient in a metric on twists: the squared motion of the projected points,
/// summed over views, and the prior's information. It makes metres and radians comparable, and motion along the beam
/// and across it. The source's metric is the identity on (w, v).
class KernelFlow {
 public:
  /// Borrows the views. `match_m`: length of the model that counts as one match [m].
  KernelFlow(const XrayViews& views, const PosePriorTerm& prior, const Pose& T_camera_centered, double match_m);

  /// Takes a scale, and features, masses and metric at the pose reached. Returns whether the model has an image.
  bool begin(const ModelSamples& model, const PairKernel& kernel);

  /// Moves along the flow as far as its Taylor series says, or less far, so that the objective does not fall. Returns
  /// how far the projected points have moved, rms [px]; 0 at rest.
  double step();

  const Pose& pose() const { return T_camera_centered_; }
  /// Of the scale that was begun [px^2].
  double objective_px2() const { return now_.total_px2; }

  /// Covariance as RegistrationResult defines it, by the Gauss-Newton system of the pairs there are.
  std::optional<Matrix6d> covariance(const ModelSamples& model, const Eigen::Vector3d& centroid) const;

 private:
  struct Alignment {
    std::vector<ViewAlignment> views;
    double total_px2 = 0;
  };

  bool alignAt(const Pose& T_camera_centered, Alignment& to) const;

  const XrayViews& views_;
  const PosePriorTerm& prior_;
  double match_m_;
  Pose T_camera_centered_;
  std::optional<PairKernel> kernel_;
  std::vector<FlowView> seen_;
  Alignment now_, trial_;
  Matrix6d picture_metric_ = Matrix6d::Zero();
  double matches_ = 0;
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/registration/xray_view.hpp"
#include "kernel_field.hpp"
#include "raw_view.hpp"

namespace angio::registration {

/// Points of the centred model with the direction of their vessel, in single precision, one array a quantity, padded so
/// that any vector width may read past the end. Padding has no weight.
struct ModelPoints {
  std::vector<float> x, y, z;     ///< About the tree's centroid [m].
  std::vector<float> tx, ty, tz;  ///< Unit tangents.
  std::vector<float> weight;      ///< Length of vessel that the point stands for, in units of the model's spacing.
  int count = 0;                  ///< Points without padding.

  /// Every `stride`-th point of the given ones, beginning in the middle of the first stride.
  static ModelPoints of(const Eigen::Matrix3Xd& points_centered, const Eigen::Matrix3Xd& tangents,
                        const Eigen::VectorXd& weights, int stride);

  RawPoints raw() const {
    return {x.data(), y.data(), z.data(), tx.data(), ty.data(), tz.data(), weight.data(), count};
  }
};

/// Part of the plane in which a view sees: u n_u + v n_v + d >= 0, which is the distance to its border [px].
struct HalfPlane {
  float n_u = 0, n_v = 0, d = 0;
};
/// Detector and collimator of a view; `to` is overwritten.
void fieldOfView(const XrayView& view, std::vector<HalfPlane>& to);

/// How much an image pull counts, of a point at which the field is F.
struct PullWeight {
  /// Mass of what is no vessel of the model: a point weighs 1 / (F + outlier_mass), so that dense places do not draw
  /// the model together (expectation-maximisation).
  float outlier_mass = 0.5f;
  /// Stiffness along the vessel relative to across it, in the approximate Hessian: 1 is the majoriser, whose steps
  /// never lower the objective; less lets the model slide along itself faster.
  float along = 1;
};

/// What one look at the field says: gradient and approximate (negative) Hessian of the sum of the points'
/// log-likelihoods, weight * log(F + outlier mass), for T exp(dx), and how well the points fit.
struct FieldSums {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();  ///< Gradient: the step is (H + prior)^-1 (g - prior).
  double fit = 0;                 ///< Sum of weight * F / (F + outlier mass): points that have found a vessel.
  double seen = 0;                ///< Sum of the weights of points in view.
};

/// One look of all points at one field, under T_view_centred: the whole of a registration step but its 6 x 6 solution.
/// Uses the widest vectors this processor has; on all of them the result is the same but for rounding.
FieldSums sampleField(const ModelPoints& model, const KernelField& field, const XrayCamera& camera,
                      const std::vector<HalfPlane>& field_of_view, const Pose& T_view_centered,
                      const PullWeight& weight);

/// Names of the vector targets that this processor can run, and their numbers for useFieldStepTarget: for the test that
/// they agree.
std::vector<std::int64_t> fieldStepTargets();
/// Restricts sampleField to one target; 0 gives the choice back. Not for use while another thread looks.
void useFieldStepTarget(std::int64_t target);

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/rod/rod_shape.hpp"

namespace angio::rod {

class BandedSystem;

/// A rod's cross-section at one of its points: round, and the same in all directions.
struct RodSection {
  double stretching_n = 0;                                    ///< E A.
  double bending_n_m2 = 0;                                    ///< E I.
  double twisting_n_m2 = 0;                                   ///< G J.
  Eigen::Vector2d curvature_per_m = Eigen::Vector2d::Zero();  ///< Without load: towards the director, and across it.
};

/// A rod without load, cut as RodShape is.
struct RodBody {
  Eigen::VectorXd lengths_m;         ///< n - 1, of the edges.
  std::vector<RodSection> sections;  ///< n, at the points.

  /// Length of rod around a point [m]: half of each edge beside it. What is held at its start has no half there.
  double share_m(Eigen::Index point) const;
};

/// Elastic energy of a discrete rod [J]: stretching, bending against the natural curvature, twisting (M. Bergou,
/// B. Audoly, E. Vouga, M. Wardetzky, E. Grinspun, Discrete viscous threads, ACM Transactions on Graphics 29(4), 2010;
/// M. Bergou et al., Discrete elastic rods, the same 27(3), 2008). Rigid motions do not change it.
///
/// Bending is |kb|^2 - 2 kappa . natural + |natural|^2 by the curvature binormal kb: without a natural curvature it
/// does not know the material frames, which their mean in the paper's formula would hold against each other.
///
/// Adds to `gradient` the exact first derivatives by the shape's freedoms. Adds to `hessian` the second ones, exact by
/// turns, and by places without those of the strains (Gauss-Newton). Both may be null.
double elasticEnergy(const RodShape& shape, const RodBody& body, Eigen::VectorXd* gradient = nullptr,
                     BandedSystem* hessian = nullptr);

/// How much an edge is compressed [N]; negative under tension.
double compression_n(const RodShape& shape, const RodBody& body, Eigen::Index edge);

}  // namespace angio::rod

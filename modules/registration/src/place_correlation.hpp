// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

namespace angio::registration {

/// A part of a correlation that depends on the distance of two places only, in units of its length: Matern 5/2 but for
/// the factors of sqrt(5), or exponential.
struct CorrelationPart {
  double share = 1;  ///< At no distance.
  double length_m = 1;
  bool smooth = true;  ///< Matern 5/2, or exponential.
};

/// Returns the sum of the parts for all pairs of two sets of places [m], 3 x n and 3 x m: n x m. Distances and parts
/// are computed in single precision, of sizes of a tree to 1e-6 of a share.
Eigen::MatrixXf placeCorrelation(const std::vector<CorrelationPart>& parts, const Eigen::Matrix3Xd& a,
                                 const Eigen::Matrix3Xd& b);

}  // namespace angio::registration

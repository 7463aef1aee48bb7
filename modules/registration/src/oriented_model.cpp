// SPDX-License-Identifier: GPL-2.0-or-later
#include "oriented_model.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {

constexpr int kMinSubset = 128, kSubsets = 4;

OrientedModel::OrientedModel(const VesselTree& given, const OrientedKernelSettings& settings)
    : resampled(angio::registration::resampled(given, settings.spacing_mm * 1e-3, settings.max_points_3d)),
      centroid(resampled.tree.centroid()),
      points(resampled.tree.points().colwise() - centroid) {
  const VesselTree& tree = resampled.tree;
  Eigen::VectorXd length = Eigen::VectorXd::Zero(tree.size());  // Of vessel that each point stands for.
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[i];
    if (parent < 0) continue;
    edges.emplace_back(parent, i);
    const double half = 0.5 * (points.col(i) - points.col(parent)).norm();
    length[i] += half;
    length[parent] += half;
  }
  spacing_m = std::max(1e-9, tree.length()) / tree.size();
  radius_m = std::sqrt(points.colwise().squaredNorm().mean());
  const Eigen::Matrix3Xd tangents = tree.tangents();
  const Eigen::VectorXd weights = length / spacing_m;
  all = ModelPoints::of(points, tangents, weights, 1);
  for (int k = 0; k < kSubsets; ++k) {
    subsets.push_back(ModelPoints::of(points, tangents, weights, std::max(1, tree.size() / (kMinSubset << k))));
  }
}

}  // namespace angio::registration

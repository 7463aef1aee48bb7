// SPDX-License-Identifier: GPL-2.0-or-later
#include "displacement_pairs.hpp"

#include <algorithm>
#include <map>
#include <nanoflann.hpp>

namespace angio::registration {

std::vector<DisplacementPair> displacementPairs(const VesselTree& tree, const IterativePnpSettings& settings) {
  std::map<std::pair<int, int>, double> weights;
  const auto add = [&](int i, int j, double weight) {
    if (i != j && weight > 0) weights[{std::max(i, j), std::min(i, j)}] += weight;
  };
  for (int i = 0; i < tree.size(); ++i) {
    if (tree.parents()[i] >= 0) add(i, tree.parents()[i], 2 * settings.w2);
  }
  const Eigen::MatrixX3d rows = tree.points().transpose();
  const nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX3d, 3> index(3, rows, 10);
  const auto wanted = static_cast<std::size_t>(settings.regulariser_neighbours) + 1;  // The point itself comes first.
  std::vector<Eigen::Index> neighbour(wanted);
  std::vector<double> distance2(wanted);
  for (int i = 0; i < tree.size(); ++i) {
    const Eigen::Vector3d p = tree.points().col(i);
    const std::size_t found = index.index->knnSearch(p.data(), wanted, neighbour.data(), distance2.data());
    for (std::size_t k = 0; k < found; ++k) add(i, static_cast<int>(neighbour[k]), settings.w3);
  }
  std::vector<DisplacementPair> pairs;
  pairs.reserve(weights.size());
  for (const auto& [pair, weight] : weights) pairs.push_back({pair.first, pair.second, weight});
  return pairs;
}

}  // namespace angio::registration

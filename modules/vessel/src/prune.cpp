// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/prune.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"

namespace angio {

VesselTree withoutLongEdges(const VesselTree& tree, double longest_m) {
  requirePositive("vessel tree", "longest_edge_mm", longest_m * 1e3);
  std::vector<int> parents = tree.parents();
  for (int i = 0; i < tree.size(); ++i) {
    int& parent = parents[static_cast<std::size_t>(i)];
    if (parent >= 0 && (tree.points().col(i) - tree.points().col(parent)).norm() > longest_m) parent = -1;
  }
  if (std::all_of(parents.begin(), parents.end(), [](int parent) { return parent < 0; })) {
    throw InputError("vessel tree", "longest_edge_mm", shown(longest_m * 1e3), "every edge is longer");
  }
  return VesselTree(tree.points(), std::move(parents), tree.radii());
}

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/tree_distance.hpp"

#include <algorithm>

namespace angio::vessel {
namespace {

double fromRoot_m(const TreeTopology& tree, const TreeLocation& place) {
  return tree.start_m(place.branch) + place.arc_m;
}

}  // namespace

std::optional<double> sharedRoute_m(const TreeTopology& tree, const TreeLocation& a, const TreeLocation& b) {
  const auto to_a = tree.pathTo(a.branch), to_b = tree.pathTo(b.branch);
  const auto parted = std::mismatch(to_a.begin(), to_a.end(), to_b.begin(), to_b.end()).first;
  if (parted == to_a.begin()) return std::nullopt;
  const int last = *(parted - 1);
  return std::min({tree.start_m(last) + tree.length_m(last), fromRoot_m(tree, a), fromRoot_m(tree, b)});
}

double alongVessels_m(const TreeTopology& tree, const TreeLocation& a, const TreeLocation& b) {
  const auto shared_m = sharedRoute_m(tree, a, b);
  if (!shared_m) return (tree.point(a) - tree.point(b)).norm();
  return fromRoot_m(tree, a) + fromRoot_m(tree, b) - 2 * *shared_m;
}

}  // namespace angio::vessel

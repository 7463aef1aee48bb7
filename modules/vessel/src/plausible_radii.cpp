// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/vessel/plausible_radii.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "angio/base/errors.hpp"

namespace angio::vessel {
namespace {

constexpr double kWidest = 4e-3;  // [m]

// How far from a root each point is, in edges.
std::vector<int> depths(const VesselTree& tree) {
  std::vector<int> depth(tree.size(), 0);
  for (const int i : tree.parentsFirst()) {
    if (tree.parents()[i] >= 0) depth[i] = depth[tree.parents()[i]] + 1;
  }
  return depth;
}

// Branches in an order in which each comes after those that start at its end.
std::vector<int> endsFirst(const VesselTree& tree) {
  const std::vector<int> depth = depths(tree);
  std::vector<int> order(tree.branches().size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return depth[tree.branches()[a].front()] > depth[tree.branches()[b].front()]; });
  return order;
}

// As vessel::arcLengths, but without contraction (CMakeLists.txt): the same radii with and without FMA.
std::vector<double> lengthsAlong(const VesselTree& tree, const std::vector<int>& branch) {
  std::vector<double> s(branch.size(), 0.0);
  for (std::size_t k = 1; k < branch.size(); ++k) {
    s[k] = s[k - 1] + (tree.points().col(branch[k]) - tree.points().col(branch[k - 1])).norm();
  }
  return s;
}

// Places k > 0 of the branch whose radius the tree knows. The first point belongs to the branch before.
std::vector<std::size_t> knownPlaces(const VesselTree& tree, const std::vector<int>& branch) {
  std::vector<std::size_t> known;
  for (std::size_t k = 1; k < branch.size(); ++k) {
    if (tree.radii()[branch[k]]) known.push_back(k);
  }
  return known;
}

// Fills the gaps between known radii in proportion to arc length, and those before the first and after the last with
// these.
void interpolate(const std::vector<int>& branch, const std::vector<double>& s, const std::vector<std::size_t>& known,
                 std::vector<std::optional<double>>& radii) {
  for (std::size_t k = 1; k < branch.size(); ++k) {
    if (radii[branch[k]]) continue;
    const auto above = std::lower_bound(known.begin(), known.end(), k);
    const std::size_t next = above == known.end() ? known.back() : *above;
    const std::size_t last = above == known.begin() ? known.front() : *(above - 1);
    const double gap = s[next] - s[last], w = gap > 0 ? (s[k] - s[last]) / gap : 0.0;
    radii[branch[k]] = (1 - w) * *radii[branch[last]] + w * *radii[branch[next]];
  }
}

// A constant radius that grows out of the parent's like a half wave, over a length that mostly lies inside the parent.
void leaveParent(const std::vector<int>& branch, const std::vector<double>& s, double parent, double own,
                 std::vector<std::optional<double>>& radii) {
  const double taper = std::min(1.5 * parent, 0.5 * s.back());
  for (std::size_t k = 1; k < branch.size(); ++k) {
    const double left = s[k] < taper ? 0.5 + 0.5 * std::cos(kPi * s[k] / taper) : 0.0;
    radii[branch[k]] = own + left * (parent - own);
  }
}

}  // namespace

VesselTree withPlausibleRadii(const VesselTree& tree, double end_radius_m) {
  requirePositive("vessel tree", "end_radius_m", end_radius_m);
  const auto& branches = tree.branches();
  const std::vector<int> order = endsFirst(tree);
  std::vector<double> own(branches.size());     // Radius of a branch, where it starts.
  std::vector<double> cubes(tree.size(), 0.0);  // Sum over the branches that start at a point.
  for (const int b : order) {
    const int end = branches[b].back();
    const auto known = knownPlaces(tree, branches[b]);
    const double murray = tree.children()[end].empty() ? end_radius_m : std::cbrt(cubes[end]);
    own[b] = known.empty() ? std::min(murray, kWidest) : *tree.radii()[branches[b][known.front()]];
    cubes[branches[b].front()] += own[b] * own[b] * own[b];
  }

  std::vector<std::optional<double>> radii = tree.radii();
  for (int i = 0; i < tree.size(); ++i) {
    if (tree.parents()[i] < 0 && !radii[i]) {
      radii[i] = tree.children()[i].empty() ? end_radius_m : std::min(std::cbrt(cubes[i]), kWidest);
    }
  }
  for (auto b = order.rbegin(); b != order.rend(); ++b) {  // Parents first, so that the start's radius is there.
    const std::vector<int>& branch = branches[*b];
    const std::vector<double> s = lengthsAlong(tree, branch);
    const auto known = knownPlaces(tree, branch);
    if (known.empty()) {
      leaveParent(branch, s, *radii[branch.front()], own[*b], radii);
    } else {
      interpolate(branch, s, known, radii);
    }
  }
  return VesselTree(tree.points(), tree.parents(), std::move(radii));
}

}  // namespace angio::vessel

// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "angio/volume/thinning.hpp"
#include "skeleton_forest.hpp"

namespace angio::volume {
namespace {

// Sets that grow together.
class Groups {
 public:
  explicit Groups(std::size_t count) : leader_(count) { std::iota(leader_.begin(), leader_.end(), 0); }
  int of(int i) {
    while (leader_[i] != i) {
      int& leader = leader_[i];
      leader = leader_[leader];
      i = leader;
    }
    return i;
  }
  bool join(int a, int b) {
    a = of(a), b = of(b);
    if (a == b) return false;
    leader_[std::max(a, b)] = std::min(a, b);
    return true;
  }

 private:
  std::vector<int> leader_;
};

struct Link {
  int a, b;
  double depth, length;
};

}  // namespace

SkeletonForest linked(const VoxelMask& skeleton, const NearestPoint& wall) {
  SkeletonForest forest;
  const VoxelGrid& grid = skeleton.grid;
  std::unordered_map<std::size_t, int> node_at;
  std::vector<Link> links;
  forEachVoxel(grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    if (!skeleton.inside[at]) return;
    const int node = static_cast<int>(forest.nodes.size());
    node_at.emplace(at, node);
    forest.nodes.push_back(v.cast<double>());
    forest.depths.push_back(wall.distance(v.cast<double>()));
    for (int k = 0; k < 13; ++k) {  // The neighbours before this one.
      const Eigen::Vector3i u = v + Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      if (!grid.holds(u)) continue;
      const auto other = node_at.find(grid.offset(u));
      if (other == node_at.end()) continue;
      links.push_back({other->second, node, std::min(forest.depths[other->second], forest.depths.back()),
                       (u - v).cast<double>().norm()});
    }
  });
  std::stable_sort(links.begin(), links.end(), [](const Link& a, const Link& b) {
    return a.depth != b.depth ? a.depth > b.depth : a.length < b.length;
  });
  Groups groups(forest.nodes.size());
  forest.links.resize(forest.nodes.size());
  int trees = static_cast<int>(forest.nodes.size());
  for (const Link& link : links) {
    if (!groups.join(link.a, link.b)) continue;
    --trees;
    forest.links[link.a].push_back(link.b);
    forest.links[link.b].push_back(link.a);
  }
  // A skeleton has no cavities; three voxels that touch each other are no loop.
  forest.cycles_cut = static_cast<int>(trees - eulerNumber(skeleton));
  return forest;
}

}  // namespace angio::volume

// SPDX-License-Identifier: GPL-2.0-or-later
#include "skeleton_forest.hpp"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "angio/volume/thinning.hpp"

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

// A tree walked from one of its nodes.
struct Walk {
  std::vector<int> order;                // Parents first.
  std::vector<int> parent;               // By node; -1 at the first.
  std::vector<double> distance, height;  // From the first node; to the farthest end below.
};

double lengthOf(const SkeletonForest& forest, int a, int b) { return (forest.nodes[a] - forest.nodes[b]).norm(); }

void walkFrom(const SkeletonForest& forest, int first, Walk& walk) {
  walk.parent.resize(forest.nodes.size(), -1);
  walk.distance.resize(forest.nodes.size(), 0);
  walk.height.resize(forest.nodes.size(), 0);
  walk.order.assign(1, first);
  walk.parent[first] = -1;
  walk.distance[first] = 0;
  for (std::size_t i = 0; i < walk.order.size(); ++i) {
    const int node = walk.order[i];
    walk.height[node] = 0;
    for (const int next : forest.links[node]) {
      if (next == walk.parent[node]) continue;
      walk.parent[next] = node;
      walk.distance[next] = walk.distance[node] + lengthOf(forest, node, next);
      walk.order.push_back(next);
    }
  }
  for (std::size_t i = walk.order.size(); i-- > 1;) {
    const int node = walk.order[i], parent = walk.parent[node];
    double& height = walk.height[parent];
    height = std::max(height, walk.height[node] + lengthOf(forest, node, parent));
  }
}

int farthestFrom(const SkeletonForest& forest, int first, Walk& walk) {
  walkFrom(forest, first, walk);
  return *std::max_element(walk.order.begin(), walk.order.end(),
                           [&](int a, int b) { return walk.distance[a] < walk.distance[b]; });
}

// visit(first node) for each tree.
template <typename Visit>
void forEachTree(const SkeletonForest& forest, const Visit& visit) {
  std::vector<bool> seen(forest.nodes.size(), false);
  Walk walk;
  for (std::size_t i = 0; i < forest.nodes.size(); ++i) {
    if (seen[i]) continue;
    walkFrom(forest, static_cast<int>(i), walk);
    for (const int node : walk.order) seen[node] = true;
    visit(static_cast<int>(i));
  }
}

SkeletonForest onlyKept(const SkeletonForest& forest, const std::vector<bool>& keep) {
  SkeletonForest result;
  result.cycles_cut = forest.cycles_cut;
  std::vector<int> now(forest.nodes.size(), -1);
  for (std::size_t i = 0; i < forest.nodes.size(); ++i) {
    if (!keep[i]) continue;
    now[i] = static_cast<int>(result.nodes.size());
    result.nodes.push_back(forest.nodes[i]);
    result.depths.push_back(forest.depths[i]);
  }
  result.links.resize(result.nodes.size());
  for (std::size_t i = 0; i < forest.nodes.size(); ++i) {
    if (!keep[i]) continue;
    for (const int other : forest.links[i]) {
      if (keep[other]) result.links[now[i]].push_back(now[other]);
    }
  }
  return result;
}

// Median depth from an end to the first fork: an end's own depth says nothing, as it lies at a wall.
double thicknessAt(const SkeletonForest& forest, int end) {
  std::vector<double> depths;
  int before = -1, at = end;
  for (;;) {
    depths.push_back(forest.depths[at]);
    const auto& links = forest.links[at];
    if (links.size() > 2 || (before >= 0 && links.size() == 1) || links.empty()) break;
    const int next = links[0] == before ? links[1] : links[0];
    before = at;
    at = next;
  }
  const auto middle = depths.begin() + depths.size() / 2;
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

int rootOf(const SkeletonForest& forest, const std::vector<int>& tree, const std::optional<Eigen::Vector3d>& root) {
  int best = tree.front();
  double best_score = -1e300;
  for (const int node : tree) {
    if (forest.links[node].size() > 1) continue;
    const double score = root ? -(forest.nodes[node] - *root).norm() : thicknessAt(forest, node);
    if (score > best_score) {
      best = node;
      best_score = score;
    }
  }
  return best;
}

void addPaths(const SkeletonForest& forest, const Walk& walk, std::vector<SkeletonPath>& paths) {
  const std::size_t first = paths.size();
  SkeletonPath trunk;
  trunk.nodes = {walk.order.front()};
  paths.push_back(trunk);
  for (std::size_t p = first; p < paths.size(); ++p) {
    // By place: the list grows meanwhile.
    for (std::size_t i = paths[p].parent >= 0 ? 1 : 0; i < paths[p].nodes.size(); ++i) {
      const int node = paths[p].nodes[i];
      std::vector<int> children;
      for (const int next : forest.links[node]) {
        if (next != walk.parent[node]) children.push_back(next);
      }
      const auto reach = [&](int child) { return walk.height[child] + lengthOf(forest, node, child); };
      std::sort(children.begin(), children.end(),
                [&](int a, int b) { return reach(a) != reach(b) ? reach(a) > reach(b) : a < b; });
      for (std::size_t k = 0; k < children.size(); ++k) {
        if (k == 0) {
          paths[p].nodes.push_back(children[0]);
        } else {
          paths.push_back({{node, children[k]}, static_cast<int>(p), static_cast<int>(i)});
        }
      }
    }
  }
}

// How far what begins with a child goes from a fork as the crow flies: a way across a wide vessel may be a long one.
double farthestOf(const SkeletonForest& forest, const Walk& walk, int fork, int child) {
  double farthest = 0;
  std::vector<int> open = {child};
  while (!open.empty()) {
    const int node = open.back();
    open.pop_back();
    farthest = std::max(farthest, lengthOf(forest, fork, node));
    for (const int next : forest.links[node]) {
      if (next != walk.parent[node]) open.push_back(next);
    }
  }
  return farthest;
}

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

SkeletonForest withoutSpurs(const SkeletonForest& forest, double shortest, double radii) {
  std::vector<bool> keep(forest.nodes.size(), true);
  Walk walk;
  forEachTree(forest, [&](int first) {
    // From an end of the longest way, which is no spur.
    walkFrom(forest, farthestFrom(forest, first, walk), walk);
    for (const int node : walk.order) {
      if (!keep[node] && node != walk.order.front()) continue;
      const auto reach = [&](int child) { return walk.height[child] + lengthOf(forest, node, child); };
      int longest = -1;
      for (const int child : forest.links[node]) {
        if (child != walk.parent[node] && (longest < 0 || reach(child) > reach(longest))) longest = child;
      }
      for (const int child : forest.links[node]) {
        if (child == walk.parent[node] || child == longest) continue;
        const double wanted = forest.depths[node] + std::max(shortest, radii * forest.depths[node]);
        // Far longer ways need no second look.
        const bool reaches =
            reach(child) >= 4 * wanted || (reach(child) >= wanted && farthestOf(forest, walk, node, child) >= wanted);
        if (!reaches) keep[child] = false;
      }
    }
    for (const int node : walk.order) {  // What hangs on a spur goes with it.
      const int parent = walk.parent[node];
      if (parent >= 0 && !keep[parent]) keep[node] = false;
    }
  });
  return onlyKept(forest, keep);
}

SkeletonForest withoutSmallTrees(const SkeletonForest& forest, double shortest, int& dropped) {
  std::vector<bool> keep(forest.nodes.size(), true);
  Walk walk;
  forEachTree(forest, [&](int first) {
    walkFrom(forest, first, walk);
    double length = 0;
    for (std::size_t i = 1; i < walk.order.size(); ++i) {
      length += lengthOf(forest, walk.order[i], walk.parent[walk.order[i]]);
    }
    if (length > 0 && length >= shortest) return;
    ++dropped;
    for (const int node : walk.order) keep[node] = false;
  });
  return onlyKept(forest, keep);
}

std::vector<SkeletonPath> pathsOf(const SkeletonForest& forest, const std::optional<Eigen::Vector3d>& root) {
  std::vector<std::vector<int>> trees;
  Walk walk;
  forEachTree(forest, [&](int first) {
    walkFrom(forest, first, walk);
    trees.push_back(walk.order);
  });
  std::size_t nearest = 0;
  double nearest_distance = 1e300;
  for (std::size_t t = 0; root && t < trees.size(); ++t) {
    for (const int node : trees[t]) {
      const double distance = (forest.nodes[node] - *root).norm();
      if (distance < nearest_distance) {
        nearest = t;
        nearest_distance = distance;
      }
    }
  }
  // The largest tree first, but the one that was asked for before it.
  std::vector<std::size_t> turns(trees.size());
  std::iota(turns.begin(), turns.end(), std::size_t{0});
  std::stable_sort(turns.begin(), turns.end(), [&](std::size_t a, std::size_t b) {
    if (root && (a == nearest) != (b == nearest)) return a == nearest;
    return trees[a].size() > trees[b].size();
  });
  std::vector<SkeletonPath> paths;
  for (const std::size_t t : turns) {
    walkFrom(forest, rootOf(forest, trees[t], t == nearest ? root : std::nullopt), walk);
    addPaths(forest, walk, paths);
  }
  return paths;
}

}  // namespace angio::volume

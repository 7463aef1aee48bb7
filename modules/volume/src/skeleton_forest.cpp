// SPDX-License-Identifier: GPL-2.0-or-later
#include "skeleton_forest.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "angio/base/groups.hpp"

namespace angio::volume {
namespace {

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

SkeletonForest onlyKept(const SkeletonForest& forest, const std::vector<bool>& keep,
                        const std::vector<SkeletonRepair>& repairs) {
  SkeletonForest result;
  result.repairs = forest.repairs;
  result.repairs.insert(result.repairs.end(), repairs.begin(), repairs.end());
  std::vector<int> now(forest.nodes.size(), -1);
  for (std::size_t i = 0; i < forest.nodes.size(); ++i) {
    if (!keep[i]) continue;
    now[i] = static_cast<int>(result.nodes.size());
    result.nodes.push_back(forest.nodes[i]);
    result.depths.push_back(forest.depths[i]);
    result.cut.push_back(forest.cut[i]);
    result.fork.push_back(forest.fork[i]);
    result.root.push_back(forest.root[i]);
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

// visit(node) for what begins with a child.
template <typename Visit>
void forEachBelow(const SkeletonForest& forest, const Walk& walk, int child, const Visit& visit) {
  std::vector<int> open = {child};
  while (!open.empty()) {
    const int node = open.back();
    open.pop_back();
    visit(node);
    for (const int next : forest.links[node]) {
      if (next != walk.parent[node]) open.push_back(next);
    }
  }
}

// How far what begins with a child goes from a fork as the crow flies: a way across a wide vessel may be a long one.
double farthestOf(const SkeletonForest& forest, const Walk& walk, int fork, int child) {
  double farthest = 0;
  forEachBelow(forest, walk, child, [&](int node) { farthest = std::max(farthest, lengthOf(forest, fork, node)); });
  return farthest;
}

// The largest depth of what begins with a child, outside of the fork's sphere; 0 of nothing.
double thicknessOutside(const SkeletonForest& forest, const Walk& walk, int fork, int child) {
  double thickest = 0;
  forEachBelow(forest, walk, child, [&](int node) {
    if (lengthOf(forest, fork, node) > forest.depths[fork]) thickest = std::max(thickest, forest.depths[node]);
  });
  return thickest;
}

bool leadsToCut(const SkeletonForest& forest, const Walk& walk, int child) {
  bool leads = false;
  forEachBelow(forest, walk, child, [&](int node) { leads = leads || forest.cut[node]; });
  return leads;
}

}  // namespace

SkeletonForest linked(SkeletonGraph graph, KissingRule kissing, const std::optional<Eigen::Vector3d>& root) {
  SkeletonForest forest;
  forest.repairs = cutCycles(graph, kissing, root);
  std::vector<Link> links;
  for (int b = 0; b < static_cast<int>(graph.nodes.size()); ++b) {
    for (const int a : graph.links[b]) {
      if (a < b) links.push_back({a, b, std::min(graph.depths[a], graph.depths[b]), lengthOf(graph, a, b)});
    }
  }
  std::stable_sort(links.begin(), links.end(), [](const Link& a, const Link& b) {
    return a.depth != b.depth ? a.depth > b.depth : a.length < b.length;
  });
  Groups groups(graph.nodes.size());
  graph.links.assign(graph.nodes.size(), {});
  for (const Link& link : links) {
    if (!groups.join(link.a, link.b)) continue;
    graph.links[link.a].push_back(link.b);
    graph.links[link.b].push_back(link.a);
  }
  static_cast<SkeletonGraph&>(forest) = std::move(graph);
  return forest;
}

SkeletonForest withoutSpurs(const SkeletonForest& forest, double shortest, double radii) {
  std::vector<bool> keep(forest.nodes.size(), true);
  std::vector<SkeletonRepair> stubs;
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
        if (reach(child) >= 4 * wanted) continue;  // Far longer ways need no second look.
        const double farthest = farthestOf(forest, walk, node, child);
        const double thickest = thicknessOutside(forest, walk, node, child);
        const bool bulge = thickest > forest.depths[node] && farthest < forest.depths[node] + 2 * thickest;
        if (farthest >= wanted && !bulge) continue;
        keep[child] = false;
        // What ends within the vessel is no more than the skeleton's noise, what was cut has been told of.
        const double out = farthest - forest.depths[node];
        if (out >= 1 && !leadsToCut(forest, walk, child)) {
          stubs.push_back({Flaw::kStub, forest.nodes[node], out, forest.depths[node]});
        }
      }
    }
    for (const int node : walk.order) {  // What hangs on a spur goes with it.
      const int parent = walk.parent[node];
      if (parent >= 0 && !keep[parent]) keep[node] = false;
    }
  });
  return onlyKept(forest, keep, stubs);
}

SkeletonForest withoutSmallTrees(const SkeletonForest& forest, double shortest) {
  std::vector<bool> keep(forest.nodes.size(), true);
  std::vector<SkeletonRepair> dropped;
  Walk walk;
  forEachTree(forest, [&](int first) {
    walkFrom(forest, first, walk);
    double length = 0;
    for (std::size_t i = 1; i < walk.order.size(); ++i) {
      length += lengthOf(forest, walk.order[i], walk.parent[walk.order[i]]);
    }
    if (length > 0 && length >= shortest) return;
    const int thickest = *std::max_element(walk.order.begin(), walk.order.end(),
                                           [&](int a, int b) { return forest.depths[a] < forest.depths[b]; });
    dropped.push_back({Flaw::kSmallTree, forest.nodes[thickest], length, forest.depths[thickest]});
    for (const int node : walk.order) keep[node] = false;
  });
  return onlyKept(forest, keep, dropped);
}

std::vector<SkeletonPath> pathsOf(const SkeletonForest& forest, const std::optional<Eigen::Vector3d>& root) {
  const auto trees = piecesOf(forest);
  const std::size_t nearest = root ? nearestPiece(forest, trees, *root) : SIZE_MAX;
  // The largest tree first, but the one that was asked for before it.
  std::vector<std::size_t> turns(trees.size());
  std::iota(turns.begin(), turns.end(), std::size_t{0});
  std::stable_sort(turns.begin(), turns.end(), [&](std::size_t a, std::size_t b) {
    if (root && (a == nearest) != (b == nearest)) return a == nearest;
    return trees[a].size() > trees[b].size();
  });
  std::vector<SkeletonPath> paths;
  Walk walk;
  for (const std::size_t t : turns) {
    walkFrom(forest, rootOf(forest, trees[t], t == nearest ? root : std::nullopt), walk);
    addPaths(forest, walk, paths);
  }
  return paths;
}

}  // namespace angio::volume

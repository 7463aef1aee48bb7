// SPDX-License-Identifier: GPL-2.0-or-later
#include "skeleton_graph.hpp"

#include <algorithm>
#include <cstdint>
#include <unordered_map>

namespace angio::volume {
namespace {

// Median depth from an end to the first fork: an end's own depth says nothing, as it lies at a wall.
double thicknessAt(const SkeletonGraph& graph, int end) {
  std::vector<double> depths;
  int before = -1, at = end;
  for (;;) {
    depths.push_back(graph.depths[at]);
    const auto& links = graph.links[at];
    if (graph.fork[at] || links.size() > 2 || (before >= 0 && links.size() == 1) || links.empty()) break;
    const int next = links[0] == before ? links[1] : links[0];
    before = at;
    at = next;
  }
  const auto middle = depths.begin() + depths.size() / 2;
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

}  // namespace

SkeletonGraph graphOf(const VoxelMask& skeleton, const NearestPoint& wall) {
  SkeletonGraph graph;
  const VoxelGrid& grid = skeleton.grid;
  std::unordered_map<std::size_t, int> node_at;
  forEachVoxel(grid.size, [&](const Eigen::Vector3i& v, std::size_t at) {
    if (!skeleton.inside[at]) return;
    const int node = static_cast<int>(graph.nodes.size());
    node_at.emplace(at, node);
    graph.nodes.push_back(v.cast<double>());
    graph.depths.push_back(wall.distance(v.cast<double>()));
    graph.links.emplace_back();
    for (int k = 0; k < 13; ++k) {  // The neighbours before this one.
      const Eigen::Vector3i u = v + Eigen::Vector3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      if (!grid.holds(u)) continue;
      const auto other = node_at.find(grid.offset(u));
      if (other == node_at.end()) continue;
      graph.links[node].push_back(other->second);
      graph.links[other->second].push_back(node);
    }
  });
  graph.cut.assign(graph.nodes.size(), false);
  graph.fork.assign(graph.nodes.size(), false);
  graph.root.assign(graph.nodes.size(), false);
  return graph;
}

std::vector<std::vector<int>> piecesOf(const SkeletonGraph& graph) {
  std::vector<std::vector<int>> pieces;
  std::vector<bool> seen(graph.nodes.size(), false);
  for (std::size_t first = 0; first < graph.nodes.size(); ++first) {
    if (seen[first]) continue;
    std::vector<int> piece = {static_cast<int>(first)};
    seen[first] = true;
    for (std::size_t i = 0; i < piece.size(); ++i) {
      for (const int next : graph.links[piece[i]]) {
        if (seen[next]) continue;
        seen[next] = true;
        piece.push_back(next);
      }
    }
    pieces.push_back(std::move(piece));
  }
  return pieces;
}

std::size_t nearestPiece(const SkeletonGraph& graph, const std::vector<std::vector<int>>& pieces,
                         const Eigen::Vector3d& place) {
  std::size_t nearest = 0;
  double nearest_distance = 1e300;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    for (const int node : pieces[p]) {
      const double distance = (graph.nodes[node] - place).norm();
      if (distance < nearest_distance) {
        nearest = p;
        nearest_distance = distance;
      }
    }
  }
  return nearest;
}

int rootOf(const SkeletonGraph& graph, const std::vector<int>& piece, const std::optional<Eigen::Vector3d>& root) {
  const auto marked = std::find_if(piece.begin(), piece.end(), [&](int node) { return graph.root[node]; });
  if (marked != piece.end()) return *marked;
  int best = piece.front();
  double best_score = -1e300;
  for (const int node : piece) {
    if (graph.links[node].size() > 1) continue;
    double score = root ? -(graph.nodes[node] - *root).norm() : thicknessAt(graph, node);
    if (graph.cut[node]) score -= 1e100;
    if (score > best_score) {
      best = node;
      best_score = score;
    }
  }
  return best;
}

void markRoots(const SkeletonGraph& other, const std::optional<Eigen::Vector3d>& root, SkeletonGraph& graph) {
  const auto pieces = piecesOf(other);
  const std::size_t nearest = root && !pieces.empty() ? nearestPiece(other, pieces, *root) : SIZE_MAX;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const Eigen::Vector3d first = other.nodes[rootOf(other, pieces[p], p == nearest ? root : std::nullopt)];
    const auto found = std::find(graph.nodes.begin(), graph.nodes.end(), first);
    graph.root[found - graph.nodes.begin()] = true;
  }
}

}  // namespace angio::volume

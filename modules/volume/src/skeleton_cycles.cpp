// SPDX-License-Identifier: GPL-2.0-or-later
#include "skeleton_cycles.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <queue>

#include "angio/base/groups.hpp"
#include "skeleton_segments.hpp"

namespace angio::volume {
namespace {

// Way along the skeleton from the root of its piece to each node (Dijkstra).
std::vector<double> distancesFromRoots(const SkeletonGraph& graph, const std::optional<Eigen::Vector3d>& root) {
  std::vector<double> distances(graph.nodes.size(), 1e300);
  using Reached = std::pair<double, int>;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> open;
  const auto pieces = piecesOf(graph);
  const std::size_t nearest = root ? nearestPiece(graph, pieces, *root) : SIZE_MAX;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    open.emplace(0, rootOf(graph, pieces[p], p == nearest ? root : std::nullopt));
    distances[open.top().second] = 0;
    while (!open.empty()) {
      const auto [distance, node] = open.top();
      open.pop();
      if (distance > distances[node]) continue;
      for (const int next : graph.links[node]) {
        const double there = distance + lengthOf(graph, node, next);
        if (there >= distances[next]) continue;
        distances[next] = there;
        open.emplace(there, next);
      }
    }
  }
  return distances;
}

// Segments that form a forest, as they are chosen.
class SegmentForest {
 public:
  explicit SegmentForest(const SkeletonSegments& skeleton)
      : segments_(skeleton.segments), at_(skeleton.junctions.size()) {}

  void add(int segment) {
    at_[segments_[segment].from].push_back(segment);
    at_[segments_[segment].to].push_back(segment);
  }
  void remove(int segment) {
    for (const int junction : {segments_[segment].from, segments_[segment].to}) {
      auto& its = at_[junction];
      its.erase(std::find(its.begin(), its.end(), segment));
    }
  }

  // The segments of the way between two junctions that are connected.
  std::vector<int> way(int from, int to) const {
    std::vector<int> open = {from}, came_by(at_.size(), -1);
    for (std::size_t i = 0; i < open.size() && open[i] != to; ++i) {
      for (const int segment : at_[open[i]]) {
        const int next = otherEnd(segment, open[i]);
        if (next == from || came_by[next] >= 0) continue;
        came_by[next] = segment;
        open.push_back(next);
      }
    }
    std::vector<int> way;
    for (int junction = to; junction != from; junction = otherEnd(way.back(), junction)) {
      way.push_back(came_by[junction]);
    }
    return way;
  }

 private:
  int otherEnd(int segment, int junction) const {
    return segments_[segment].from == junction ? segments_[segment].to : segments_[segment].from;
  }

  const std::vector<Segment>& segments_;
  std::vector<std::vector<int>> at_;  // By junction.
};

struct CutPlace {
  int segment = 0;
  std::size_t node = 1;  // Place in the segment.
};

void cutAt(const CutPlace& place, const SkeletonSegments& skeleton, SkeletonGraph& graph) {
  const Segment& segment = skeleton.segments[place.segment];
  const int a = segment.nodes[place.node], b = segment.nodes[place.node + 1];
  for (const auto& [node, other] : {std::pair(a, b), std::pair(b, a)}) {
    auto& links = graph.links[node];
    links.erase(std::find(links.begin(), links.end(), other));
    graph.cut[node] = true;
  }
  for (const int junction : {segment.from, segment.to}) {
    for (const int node : skeleton.junctions[junction]) graph.fork[node] = true;
  }
}

// Of the loop's thinnest places the one farthest from the root.
CutPlace placeOfCut(const SkeletonGraph& graph, const SkeletonSegments& skeleton, const std::vector<int>& loop,
                    const std::vector<double>& distances) {
  constexpr double kAsThin = 0.5;  // Depths are no better known [voxels].
  double thinnest = 1e300;
  for (const int s : loop) {
    const Segment& segment = skeleton.segments[s];
    thinnest = std::min(thinnest, graph.depths[segment.nodes[segment.thinnest]]);
  }
  CutPlace best;
  double farthest = -1;
  for (const int s : loop) {
    const auto& nodes = skeleton.segments[s].nodes;
    for (std::size_t i = 1; i + 1 < nodes.size(); ++i) {
      if (graph.depths[nodes[i]] > thinnest + kAsThin || distances[nodes[i]] <= farthest) continue;
      farthest = distances[nodes[i]];
      best = {s, i};
    }
  }
  return best;
}

// Places in `segments`: contacts last, the others by their thinnest place, the widest first.
std::vector<int> orderOf(const SkeletonGraph& graph, const SkeletonSegments& skeleton,
                         const std::vector<bool>& contact) {
  std::vector<int> order(skeleton.segments.size());
  std::iota(order.begin(), order.end(), 0);
  const auto depth = [&](int s) { return graph.depths[skeleton.segments[s].nodes[skeleton.segments[s].thinnest]]; };
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return contact[a] != contact[b] ? contact[b] : depth(a) > depth(b); });
  return order;
}

}  // namespace

std::vector<SkeletonRepair> cutCycles(SkeletonGraph& graph, KissingRule kissing,
                                      const std::optional<Eigen::Vector3d>& root) {
  const SkeletonSegments skeleton = segmentsOf(graph);
  const std::vector<double> distances = distancesFromRoots(graph, root);
  const std::vector<bool> contact = contactsOf(graph, skeleton);
  Groups groups(skeleton.junctions.size());
  SegmentForest forest(skeleton);
  std::vector<SkeletonRepair> repairs;
  std::vector<CutPlace> cuts;
  for (const int s : orderOf(graph, skeleton, contact)) {
    const Segment& segment = skeleton.segments[s];
    const bool closes = groups.of(segment.from) == groups.of(segment.to);
    if (!closes && !(contact[s] && kissing == KissingRule::kCut)) {
      groups.join(segment.from, segment.to);
      forest.add(s);
      continue;
    }
    CutPlace cut{s, segment.thinnest};
    double length = segment.length;
    if (closes) {
      std::vector<int> loop = forest.way(segment.from, segment.to);
      for (const int other : loop) length += skeleton.segments[other].length;
      loop.push_back(s);
      if (!contact[s]) cut = placeOfCut(graph, skeleton, loop, distances);
      if (cut.segment != s) {
        forest.remove(cut.segment);
        forest.add(s);
      }
    }
    const int node = skeleton.segments[cut.segment].nodes[cut.node];
    const Flaw flaw = !closes ? Flaw::kKissing : contact[s] ? Flaw::kSelfTouch : Flaw::kCycle;
    repairs.push_back({flaw, graph.nodes[node], length, graph.depths[node]});
    cuts.push_back(cut);
  }
  for (const CutPlace& cut : cuts) cutAt(cut, skeleton, graph);
  return repairs;
}

}  // namespace angio::volume

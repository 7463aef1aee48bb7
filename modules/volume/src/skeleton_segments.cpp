// SPDX-License-Identifier: GPL-2.0-or-later
#include "skeleton_segments.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_set>

namespace angio::volume {
namespace {

// From a junction's node along `next` to the next junction.
Segment walked(const SkeletonGraph& graph, const std::vector<int>& junction_of, int first, int next) {
  Segment segment;
  segment.from = junction_of[first];
  segment.nodes = {first, next};
  while (junction_of[segment.nodes.back()] < 0) {
    const int at = segment.nodes.back(), before = segment.nodes[segment.nodes.size() - 2];
    const auto& links = graph.links[at];
    segment.nodes.push_back(links[0] == before ? links[1] : links[0]);
  }
  segment.to = junction_of[segment.nodes.back()];
  for (std::size_t i = 1; i < segment.nodes.size(); ++i) {
    segment.length += lengthOf(graph, segment.nodes[i - 1], segment.nodes[i]);
    if (i + 1 < segment.nodes.size() && graph.depths[segment.nodes[i]] < graph.depths[segment.nodes[segment.thinnest]])
      segment.thinnest = i;
  }
  return segment;
}

void addSegments(const SkeletonGraph& graph, const std::vector<int>& junction_of, int junction, std::vector<bool>& seen,
                 SkeletonSegments& result) {
  for (const int node : std::vector<int>(result.junctions[junction])) {
    for (const int next : graph.links[node]) {
      if (junction_of[next] >= 0 || seen[next]) continue;
      result.segments.push_back(walked(graph, junction_of, node, next));
      const auto& nodes = result.segments.back().nodes;
      for (std::size_t i = 1; i + 1 < nodes.size(); ++i) seen[nodes[i]] = true;
    }
  }
}

int addJunction(const SkeletonGraph& graph, int first, std::vector<int>& junction_of, SkeletonSegments& result) {
  const int number = static_cast<int>(result.junctions.size());
  std::vector<int> group = {first};
  junction_of[first] = number;
  for (std::size_t i = 0; i < group.size(); ++i) {
    for (const int next : graph.links[group[i]]) {
      if (graph.links[next].size() == 2 || junction_of[next] >= 0) continue;
      junction_of[next] = number;
      group.push_back(next);
    }
  }
  result.junctions.push_back(std::move(group));
  return number;
}

// The two of the vessels at a junction that go on most straight, a diameter away, but for ways through `blocked` nodes.
struct Passage {
  Eigen::Vector3d along;  // From one to the other; not a unit vector.
  double cosine = 1;      // Between their directions: -1 is straight.
  double depth = 0;       // Of the thinner one.
};

Passage passageAt(const SkeletonGraph& graph, const std::vector<int>& junction, const Eigen::Vector3d& middle,
                  double radius, const std::unordered_set<int>& blocked) {
  std::vector<int> open = junction, crossing;
  std::unordered_set<int> seen = blocked;
  seen.insert(junction.begin(), junction.end());
  for (std::size_t i = 0; i < open.size(); ++i) {
    if ((graph.nodes[open[i]] - middle).norm() > 2 * radius) {
      crossing.push_back(open[i]);
      continue;
    }
    for (const int next : graph.links[open[i]]) {
      if (seen.insert(next).second) open.push_back(next);
    }
  }
  Passage best;
  for (const int a : crossing) {
    for (const int b : crossing) {
      const Eigen::Vector3d u = (graph.nodes[a] - middle).normalized(), v = (graph.nodes[b] - middle).normalized();
      if (u.dot(v) < best.cosine) best = {u - v, u.dot(v), std::min(graph.depths[a], graph.depths[b])};
    }
  }
  return best;
}

Eigen::Vector3d middleOf(const SkeletonGraph& graph, const std::vector<int>& junction) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int node : junction) sum += graph.nodes[node];
  return sum / static_cast<double>(junction.size());
}

double depthOf(const SkeletonGraph& graph, const std::vector<int>& junction) {
  double depth = 0;
  for (const int node : junction) depth = std::max(depth, graph.depths[node]);
  return depth;
}

// `blocked` are nodes of this segment and of other contacts.
bool isContact(const SkeletonGraph& graph, const SkeletonSegments& skeleton, const Segment& segment,
               const std::unordered_set<int>& blocked) {
  constexpr double kThinner = 0.9;    // Of the vessels' radii: beyond, about a third of a diameter overlaps.
  constexpr double kStraight = -0.5;  // Cosine: the vessel bends by at most 60 degrees.
  constexpr double kSideways = 0.5;   // Cosine: at least 60 degrees away from the vessel.
  constexpr double kReach = 2;        // Of both radii: voxels of thick slices touch with their corners.
  if (segment.from == segment.to) return false;
  const auto &from = skeleton.junctions[segment.from], &to = skeleton.junctions[segment.to];
  const Eigen::Vector3d a = middleOf(graph, from), b = middleOf(graph, to);
  const double radius_a = depthOf(graph, from), radius_b = depthOf(graph, to);
  if ((b - a).norm() > kReach * (radius_a + radius_b) + 1) return false;
  const Passage at_a = passageAt(graph, from, a, radius_a, blocked);
  const Passage at_b = passageAt(graph, to, b, radius_b, blocked);
  for (const Passage& passage : {at_a, at_b}) {
    if (passage.cosine > kStraight) return false;
    if (std::abs(passage.along.normalized().dot((b - a).normalized())) > kSideways) return false;
  }
  return graph.depths[segment.nodes[segment.thinnest]] < kThinner * std::min(at_a.depth, at_b.depth);
}

}  // namespace

SkeletonSegments segmentsOf(const SkeletonGraph& graph) {
  SkeletonSegments result;
  std::vector<int> junction_of(graph.nodes.size(), -1);
  std::vector<bool> seen(graph.nodes.size(), false);
  const auto all = static_cast<int>(graph.nodes.size());
  for (int node = 0; node < all; ++node) {
    if (graph.links[node].size() != 2 && junction_of[node] < 0) addJunction(graph, node, junction_of, result);
  }
  const int forks = static_cast<int>(result.junctions.size());
  for (int j = 0; j < forks; ++j) addSegments(graph, junction_of, j, seen, result);
  for (int node = 0; node < all; ++node) {  // What is left are rings: one node of each is taken for a junction.
    if (junction_of[node] >= 0 || seen[node]) continue;
    const int ring = static_cast<int>(result.junctions.size());
    junction_of[node] = ring;
    result.junctions.push_back({node});
    addSegments(graph, junction_of, ring, seen, result);
  }
  return result;
}

std::vector<bool> contactsOf(const SkeletonGraph& graph, const SkeletonSegments& skeleton) {
  const auto count = static_cast<int>(skeleton.segments.size());
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  const auto depth = [&](int s) { return graph.depths[skeleton.segments[s].nodes[skeleton.segments[s].thinnest]]; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return depth(a) < depth(b); });
  std::vector<bool> contacts(count, false);
  std::unordered_set<int> blocked;  // Nodes of the contacts so far.
  for (const int s : order) {
    const auto& nodes = skeleton.segments[s].nodes;
    blocked.insert(nodes.begin() + 1, nodes.end() - 1);
    contacts[s] = isContact(graph, skeleton, skeleton.segments[s], blocked);
    if (contacts[s]) continue;
    for (auto node = nodes.begin() + 1; node != nodes.end() - 1; ++node) blocked.erase(*node);
  }
  return contacts;
}

}  // namespace angio::volume

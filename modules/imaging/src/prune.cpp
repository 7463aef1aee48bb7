// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <map>

#include "skeleton_graph.hpp"

namespace angio::imaging {
namespace {

using Branch = SkeletonGraph::Branch;

constexpr float kAlone = 2.5f;

class Pruning {
 public:
  Pruning(SkeletonGraph& graph, const cv::Mat& distance, const PruningRules& rules)
      : graph_(graph), distance_(distance), rules_(rules), lengths_(graph.branches.size(), kUnknown) {}

  void run() {
    dropRings();
    while (dropSpurs()) joinPassedNodes();
    joinPassedNodes();
    while (contractBridges()) {
      dropRings();
      joinPassedNodes();
    }
    dropStubs();
  }

 private:
  // Lengths are asked for again and again, and few change between.
  float lengthOf(const Branch& branch) {
    float& length = lengths_[&branch - graph_.branches.data()];
    if (length == kUnknown) length = angio::imaging::lengthOf(graph_, branch);
    return length;
  }

  void forgetLength(const Branch& branch) { lengths_[&branch - graph_.branches.data()] = kUnknown; }

  // A ring about a hole in the mask no wider than the vessel, and the longer way around such a hole.
  void dropRings() {
    std::map<std::pair<int, int>, Branch*> shortest;
    for (Branch& branch : graph_.branches) {
      if (!branch.alive) continue;
      const float length = lengthOf(branch);
      if (branch.closed ? length < 4 * rules_.min_branch
                        : branch.begin >= 0 && branch.begin == branch.end &&
                              length < 2 * (rules_.min_branch + graph_.nodes[branch.begin].radius)) {
        graph_.drop(branch);
        continue;
      }
      if (branch.closed || branch.begin < 0 || branch.end < 0 || branch.begin == branch.end) continue;
      if (length > rules_.min_branch + graph_.nodes[branch.begin].radius) continue;
      Branch*& other = shortest[std::minmax(branch.begin, branch.end)];
      if (other == nullptr) {
        other = &branch;
        continue;
      }
      Branch& longer = length < lengthOf(*other) ? *other : branch;
      if (&longer == other) other = &branch;
      graph_.drop(longer);
    }
  }

  // Shortest first: of a fork at a blunt end one tine goes, and the other is then the vessel's end.
  bool dropSpurs() {
    std::vector<std::pair<float, Branch*>> spurs;
    for (Branch& branch : graph_.branches) {
      if (!branch.alive || (branch.begin < 0) == (branch.end < 0)) continue;
      const auto& node = graph_.nodes[std::max(branch.begin, branch.end)];
      const float length = lengthOf(branch);
      if (length - node.radius < rules_.min_branch) spurs.emplace_back(length, &branch);
    }
    std::stable_sort(spurs.begin(), spurs.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    bool changed = false;
    for (const auto& [length, branch] : spurs) {
      if (graph_.nodes[std::max(branch->begin, branch->end)].degree < 3) continue;
      graph_.drop(*branch);
      changed = true;
    }
    return changed;
  }

  void joinPassedNodes() {
    meetings_.assign(graph_.nodes.size(), {});
    for (std::size_t b = 0; b < graph_.branches.size(); ++b) {
      const Branch& branch = graph_.branches[b];
      if (!branch.alive) continue;
      if (branch.begin >= 0) meetings_[branch.begin].add(static_cast<int>(b));
      if (branch.end >= 0) meetings_[branch.end].add(static_cast<int>(b));
    }
    for (std::size_t n = 0; n < meetings_.size(); ++n) {
      const int node = static_cast<int>(n);
      const auto [count, first, second] = meetings_[n];
      if (count == 1) release(graph_.branches[first], node);
      if (count != 2) continue;
      if (first == second) {
        closeRing(graph_.branches[first], node);
        continue;
      }
      joinAt(node, graph_.branches[first], graph_.branches[second]);
      // The second lives on in the first: where it ends, later, it must be found there.
      const int end = graph_.branches[first].end;
      if (end >= 0) meetings_[end].replace(second, first);
    }
  }

  // A node that only one branch still reaches is that branch's free end.
  void release(Branch& branch, int node) {
    if (branch.begin == node) {
      branch.begin = -1;
      branch.line.insert(branch.line.begin(), graph_.nodes[node].position);
    } else {
      branch.end = -1;
      branch.line.push_back(graph_.nodes[node].position);
    }
    graph_.nodes[node].degree = 0;
    forgetLength(branch);
  }

  void closeRing(Branch& branch, int node) {
    branch.line.push_back(graph_.nodes[node].position);
    branch.begin = branch.end = -1;
    branch.closed = true;
    graph_.nodes[node].degree = 0;
    forgetLength(branch);
  }

  void joinAt(int node, Branch& first, Branch& second) {
    if (first.begin == node) first.reverse();
    if (second.begin != node) second.reverse();
    first.line.push_back(graph_.nodes[node].position);
    first.line.insert(first.line.end(), second.line.begin(), second.line.end());
    first.end = second.end;
    second.alive = false;
    graph_.nodes[node].degree = 0;
    forgetLength(first);
  }

  // Two vessels that cross share their middle for about a radius; the skeleton makes two junctions of it.
  bool contractBridges() {
    for (Branch& bridge : graph_.branches) {
      if (!bridge.alive || bridge.begin < 0 || bridge.end < 0 || bridge.begin == bridge.end) continue;
      const int kept = bridge.begin, gone = bridge.end;
      auto &a = graph_.nodes[kept], &b = graph_.nodes[gone];
      if (a.degree < 3 || b.degree < 3 || lengthOf(bridge) > 1.5f * std::max(a.radius, b.radius)) continue;
      graph_.drop(bridge);
      a.position = 0.5f * (a.position + b.position);
      a.radius = std::max(a.radius, b.radius);
      a.degree += b.degree;
      b.degree = 0;
      for (Branch& branch : graph_.branches) {
        if (branch.begin == gone) branch.begin = kept;
        if (branch.end == gone) branch.end = kept;
        if (branch.begin == kept || branch.end == kept) forgetLength(branch);
      }
      return true;
    }
    return false;
  }

  // A line that stands alone must be longer than it is wide, and longer than one that a vessel vouches for: blobs and
  // shreds of ribs are no vessels.
  void dropStubs() {
    for (Branch& branch : graph_.branches) {
      if (!branch.alive || branch.closed || branch.begin >= 0 || branch.end >= 0) continue;
      const float width = branch.line.empty() ? 0 : 2 * nearestPixel(distance_, branch.line[branch.line.size() / 2]);
      if (lengthOf(branch) < std::max(kAlone * rules_.min_branch, width)) graph_.drop(branch);
    }
  }

  // Branches that end at a node: how many, and which if they are one or two.
  struct Meeting {
    int count = 0, first = -1, second = -1;

    void add(int branch) {
      (count == 0 ? first : second) = branch;
      ++count;
    }
    void replace(int gone, int by) {
      if (first == gone) first = by;
      if (second == gone) second = by;
    }
  };
  static constexpr float kUnknown = -1;

  SkeletonGraph& graph_;
  const cv::Mat& distance_;
  PruningRules rules_;
  std::vector<float> lengths_;  // Of the branches, as far as they are known.
  std::vector<Meeting> meetings_;
};

}  // namespace

void prune(SkeletonGraph& graph, const cv::Mat& distance, const PruningRules& rules) {
  Pruning(graph, distance, rules).run();
}

}  // namespace angio::imaging

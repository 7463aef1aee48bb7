// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "quantile.hpp"
#include "skeleton_graph.hpp"

namespace angio::imaging {
namespace {

using Branch = SkeletonGraph::Branch;

// A line goes on straight if it turns by less than 35 deg, and two lines that cross differ by 20 deg at least.
constexpr float kStraight = -0.82f;

// What a change of radius by a factor of e weighs against straightness: a parent goes on in the like of it.
constexpr float kUnlike = 0.15f;

// Points of a branch that its junction may disturb.
constexpr std::size_t kAway = 3;

// Vessels that cross at a small angle share a stretch of this many radii.
constexpr float kSharedRadii = 6, kAlong = 0.7f;

struct End {
  int branch = 0;
  bool at_begin = false;
  cv::Point2f outwards;  // Away from the node.
  float radius = 1;
};

class Passing {
 public:
  Passing(SkeletonGraph& graph, const cv::Mat& radius) : graph_(graph), radius_(radius), at_(graph.nodes.size()) {
    for (std::size_t b = 0; b < graph.branches.size(); ++b) {
      const Branch& branch = graph.branches[b];
      if (branch.begin >= 0) at_[branch.begin].push_back(static_cast<int>(b));
      if (branch.end >= 0 && branch.end != branch.begin) at_[branch.end].push_back(static_cast<int>(b));
    }
  }

  void bridges() {
    for (std::size_t b = 0; b < graph_.branches.size(); ++b) {
      const Branch& bridge = graph_.branches[b];
      if (!bridge.alive || bridge.begin < 0 || bridge.end < 0 || bridge.begin == bridge.end) continue;
      const auto &from = graph_.nodes[bridge.begin], &to = graph_.nodes[bridge.end];
      if (from.degree != 3 || to.degree != 3) continue;
      if (lengthOf(graph_, bridge) > kSharedRadii * std::max(from.radius, to.radius)) continue;
      passBridge(bridge.begin, bridge.end, static_cast<int>(b));
    }
  }

  void nodes() {
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
      if (graph_.nodes[n].degree >= 3) passNode(static_cast<int>(n));
    }
  }

 private:
  std::vector<End> endsAt(int node, int bridge) const {
    std::vector<End> ends;
    for (const int b : at_[node]) {
      const Branch& branch = graph_.branches[b];
      if (!branch.alive || branch.line.empty() || b == bridge) continue;
      if (branch.begin == node)
        ends.push_back({b, true, directionOf(branch, node, true), radiusOf(branch, node, true)});
      if (branch.end == node)
        ends.push_back({b, false, directionOf(branch, node, false), radiusOf(branch, node, false)});
    }
    return ends;
  }

  // Of the stretch just beyond the junction.
  cv::Point2f directionOf(const Branch& branch, int node, bool at_begin) const {
    const std::size_t n = branch.line.size();
    const auto point = [&](std::size_t i) {
      return branch.line[at_begin ? std::min(i, n - 1) : n - 1 - std::min(i, n - 1)];
    };
    const auto near = static_cast<std::size_t>(graph_.nodes[node].radius + 1.5f);
    const std::size_t far = near + std::max<std::size_t>(8, 2 * near);
    const cv::Point2f chord = n > near + 4 ? point(far) - point(near) : point(n - 1) - graph_.nodes[node].position;
    const float length = static_cast<float>(cv::norm(chord));
    return length > 0 ? chord * (1 / length) : cv::Point2f(0, 0);
  }

  // Of the same stretch, 1 at least.
  float radiusOf(const Branch& branch, int node, bool at_begin) const {
    const std::size_t n = branch.line.size();
    const auto near = static_cast<std::size_t>(graph_.nodes[node].radius + 1.5f);
    float sum = 0;
    int count = 0;
    for (std::size_t i = std::min(near, n - 1); i < std::min(n, near + 12); ++i) {
      const cv::Point2f p = branch.line[at_begin ? i : n - 1 - i];
      const float r = nearestPixel(radius_, p);
      if (r > 0) {
        sum += r;
        ++count;
      }
    }
    return count > 0 ? std::max(1.0f, sum / static_cast<float>(count)) : 1;
  }

  // The straightest pair first, then what is left.
  void passNode(int node) {
    std::vector<End> ends = endsAt(node, -1);
    int passing = 0;
    while (ends.size() >= 2) {
      std::size_t first = 0, second = 0;
      float best = kStraight;
      for (std::size_t i = 0; i < ends.size(); ++i) {
        for (std::size_t j = i + 1; j < ends.size(); ++j) {
          const float turn =
              ends[i].outwards.dot(ends[j].outwards) + kUnlike * std::abs(std::log(ends[i].radius / ends[j].radius));
          if (turn >= best || ends[i].branch == ends[j].branch) continue;
          best = turn;
          first = i;
          second = j;
        }
      }
      if (first == second) break;
      const SkeletonGraph::Node& at = graph_.nodes[node];
      const int through = unite({ends[first], ends[second]}, {at.position});
      // Two vessels that pass hide each other; a parent is there to be seen beside its child.
      if (++passing == 2) graph_.crossings.push_back({at.position, at.radius + 1.5f});
      if (passing == 1) graph_.nodes[node].through = through;
      // What else of the two ends here, as a loop does, is not where it was.
      const int a = ends[first].branch, b = ends[second].branch;
      ends.erase(std::remove_if(ends.begin(), ends.end(), [&](const End& e) { return e.branch == a || e.branch == b; }),
                 ends.end());
    }
    graph_.nodes[node].degree = static_cast<int>(ends.size());
  }

  // Of four branches that leave a bridge, two at each of its ends, pairs of one from each that are straight lines.
  void passBridge(int first_node, int second_node, int bridge) {
    const std::vector<End> a = endsAt(first_node, bridge), b = endsAt(second_node, bridge);
    if (a.size() != 2 || b.size() != 2) return;
    const std::set<int> branches{a[0].branch, a[1].branch, b[0].branch, b[1].branch};
    if (branches.size() != 4) return;
    std::pair<End, End> one, two;
    float best = 2 * kStraight;
    bool found = false;
    const auto consider = [&](const End& p, const End& q, const End& r, const End& s) {
      const float first = p.outwards.dot(q.outwards), second = r.outwards.dot(s.outwards);
      if (first > kStraight || second > kStraight || first + second > best) return;
      if (!runsAlong(p, q, first_node, second_node) || !runsAlong(r, s, first_node, second_node)) return;
      best = first + second;
      one = {p, q};
      two = {r, s};
      found = true;
    };
    consider(a[0], b[0], a[1], b[1]);
    consider(a[0], b[1], a[1], b[0]);
    if (!found) return;
    auto &from = graph_.nodes[first_node], &to = graph_.nodes[second_node];
    Branch& between = graph_.branches[bridge];
    const float reach = 0.5f * lengthOf(graph_, between) + std::max(from.radius, to.radius) + 1.5f;
    graph_.crossings.push_back({0.5f * (from.position + to.position), reach});
    between.alive = false;
    from.degree = to.degree = 0;
    // Straight lines, and not the shared one, pass the place.
    unite(one, {});
    unite(two, {});
  }

  // Whether a line from one node to the other goes the way its ends do: a bridge between two parallel vessels lies
  // across them.
  bool runsAlong(const End& first, const End& second, int first_node, int second_node) const {
    const cv::Point2f between = graph_.nodes[second_node].position - graph_.nodes[first_node].position;
    const float length = static_cast<float>(cv::norm(between));
    return length < 2 ||
           (-first.outwards.dot(between) > kAlong * length && second.outwards.dot(between) > kAlong * length);
  }

  // The branch that both are then.
  int unite(const std::pair<End, End>& pair, const std::vector<cv::Point2f>& shared) {
    Branch &first = graph_.branches[pair.first.branch], &second = graph_.branches[pair.second.branch];
    if (pair.first.at_begin) first.reverse();
    if (!pair.second.at_begin) second.reverse();
    const cv::Point2f from = first.line.back(), to = second.line.front();
    first.line.insert(first.line.end(), shared.begin(), shared.end());
    const int pieces = shared.empty() ? static_cast<int>(cv::norm(to - from)) : 0;
    for (int k = 1; k < pieces; ++k) {
      first.line.push_back(from + (to - from) * (static_cast<float>(k) / static_cast<float>(pieces)));
    }
    first.line.insert(first.line.end(), second.line.begin(), second.line.end());
    first.end = second.end;
    second.alive = false;
    if (first.end >= 0) {
      std::vector<int>& there = at_[first.end];
      const auto place = std::lower_bound(there.begin(), there.end(), pair.first.branch);
      if (place == there.end() || *place != pair.first.branch) there.insert(place, pair.first.branch);
    }
    for (SkeletonGraph::Node& node : graph_.nodes) {
      if (node.through == pair.second.branch) node.through = pair.first.branch;
    }
    return pair.first.branch;
  }

  SkeletonGraph& graph_;
  const cv::Mat& radius_;
  std::vector<std::vector<int>> at_;  // By node, in ascending order: branches that end there, or did.
};

}  // namespace

void settleRadii(SkeletonGraph& graph, const cv::Mat& radius) {
  for (SkeletonGraph::Node& node : graph.nodes) node.radius = 1;
  const auto settle = [&](int n, const Branch& branch, bool at_begin) {
    if (n < 0) return;
    std::vector<float> near;
    near.reserve(12);
    for (std::size_t i = kAway; i < std::min(branch.line.size(), kAway + 12); ++i) {
      const cv::Point2f p = branch.line[at_begin ? i : branch.line.size() - 1 - i];
      const float r = nearestPixel(radius, p);
      if (r > 0) near.push_back(r);
    }
    if (near.empty()) return;
    graph.nodes[n].radius = std::max(graph.nodes[n].radius, medianOf(near));
  };
  for (const Branch& branch : graph.branches) {
    if (!branch.alive) continue;
    settle(branch.begin, branch, true);
    settle(branch.end, branch, false);
  }
}

void passJunctions(SkeletonGraph& graph, const cv::Mat& radius) {
  Passing passing(graph, radius);
  passing.bridges();
  passing.nodes();
}

}  // namespace angio::imaging

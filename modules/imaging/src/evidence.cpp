// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>

#include "skeleton_graph.hpp"

namespace angio::imaging {
namespace {

using Branch = SkeletonGraph::Branch;

// A line of high contrast proves no more than that there is one.
constexpr float kMaxSalience = 15;

class Components {
 public:
  explicit Components(std::size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0); }

  int of(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(int a, int b) { parent_[of(a)] = of(b); }

 private:
  std::vector<int> parent_;
};

struct Sums {
  float length = 0, evidence2 = 0;
};

// Noise agrees with itself over about a filter's width, and so do lines that are not there: what counts is how many
// widths a line is long, and by how much it stands out over them.
Sums sumsOf(const SkeletonGraph& graph, const Branch& branch, const cv::Mat& salience, const cv::Mat& radius) {
  Sums sums;
  sums.length = lengthOf(graph, branch);
  if (branch.line.empty()) return sums;
  float stands_out = 0, width = 0;
  int seen = 0;
  for (const cv::Point2f& p : branch.line) {
    const int x = std::clamp(static_cast<int>(p.x + 0.5f), 0, radius.cols - 1);
    const int y = std::clamp(static_cast<int>(p.y + 0.5f), 0, radius.rows - 1);
    if (!(radius.at<float>(y, x) > 0)) continue;  // Bridged gaps.
    stands_out += std::min(salience.at<float>(y, x), kMaxSalience);
    width += std::max(1.0f, radius.at<float>(y, x));
    ++seen;
  }
  if (seen == 0) return sums;
  const float mean = stands_out / static_cast<float>(seen);
  sums.evidence2 = mean * mean * sums.length * static_cast<float>(seen) / width;
  return sums;
}

}  // namespace

void dropWeak(SkeletonGraph& graph, const cv::Mat& salience, const cv::Mat& radius, const EvidenceRules& rules) {
  Components components(graph.nodes.size() + graph.branches.size());
  const int nodes = static_cast<int>(graph.nodes.size());
  std::vector<Sums> total(graph.nodes.size() + graph.branches.size());
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    const Branch& branch = graph.branches[b];
    if (!branch.alive) continue;
    if (branch.begin >= 0) components.unite(nodes + static_cast<int>(b), branch.begin);
    if (branch.end >= 0) components.unite(nodes + static_cast<int>(b), branch.end);
  }
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    if (!graph.branches[b].alive) continue;
    const Sums sums = sumsOf(graph, graph.branches[b], salience, radius);
    Sums& to = total[components.of(nodes + static_cast<int>(b))];
    to.length += sums.length;
    to.evidence2 += sums.evidence2;
  }
  for (std::size_t b = 0; b < graph.branches.size(); ++b) {
    Branch& branch = graph.branches[b];
    if (!branch.alive) continue;
    const Sums& sums = total[components.of(nodes + static_cast<int>(b))];
    if (sums.length >= rules.min_line && sums.evidence2 >= rules.evidence * rules.evidence) continue;
    branch.alive = false;
    if (branch.begin >= 0) --graph.nodes[branch.begin].degree;
    if (branch.end >= 0) --graph.nodes[branch.end].degree;
  }
}

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#include "skeleton_graph.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <opencv2/core.hpp>
#include <unordered_map>

#include "framed_masks.hpp"

namespace angio::imaging {
namespace {

using Branch = SkeletonGraph::Branch;

constexpr std::uint8_t kLine = 1, kJunction = 2, kWalked = 3;

// A line of high contrast proves no more than that there is one.
constexpr float kMaxSalience = 15;

float distanceBetween(const cv::Point2f& a, const cv::Point2f& b) { return static_cast<float>(cv::norm(a - b)); }

class Tracer {
 public:
  Tracer(cv::Mat& framed, const cv::Mat& distance) : distance_(distance), framed_(framed) {
    row_ = static_cast<int>(framed_.step);
    // The four straight neighbours come first, so that a walk does not cut the corner of a stair.
    around_ = {1, -row_, -1, row_, 1 - row_, -1 - row_, row_ - 1, row_ + 1};
    pixel_ = framed_.ptr();
    classify();
  }

  SkeletonGraph trace() {
    findNodes();
    for (std::size_t n = 0; n < members_.size(); ++n) {
      for (const int p : members_[n]) {
        for (const int step : around_) {
          if (pixel_[p + step] == kLine) walk(p + step, p, static_cast<int>(n));
        }
      }
    }
    for (const int p : line_pixels_) {
      if (pixel_[p] == kLine && neighbours(p) == 1) walk(p, p, -1);
    }
    for (const int p : line_pixels_) {
      if (pixel_[p] != kLine) continue;
      walk(p, p, -1);
      graph_.branches.back().closed = true;
    }
    return std::move(graph_);
  }

 private:
  int neighbours(int p) const {
    int count = 0;
    for (const int step : around_) count += pixel_[p + step] != 0 ? 1 : 0;
    return count;
  }

  cv::Point2f positionOf(int p) const { return {static_cast<float>(p % row_ - 1), static_cast<float>(p / row_ - 1)}; }

  void classify() {
    forEachSet(framed_, [&](std::uint8_t* pixel) {
      *pixel = kLine;
      const int p = static_cast<int>(pixel - pixel_), count = neighbours(p);
      if (count == 0) *pixel = 0;
      if (count >= 3) junctions_.push_back(p);
      if (count == 1 || count == 2) line_pixels_.push_back(p);
    });
    for (const int p : junctions_) pixel_[p] = kJunction;
  }

  void findNodes() {
    for (const int seed : junctions_) {
      if (pixel_[seed] != kJunction || nodeAt(seed) >= 0) continue;
      std::vector<int> cluster{seed};
      for (std::size_t next = 0; next < cluster.size(); ++next) {
        for (const int step : around_) {
          const int q = cluster[next] + step;
          if (pixel_[q] == kJunction && std::find(cluster.begin(), cluster.end(), q) == cluster.end()) {
            cluster.push_back(q);
          }
        }
      }
      SkeletonGraph::Node node;
      for (const int p : cluster) {
        node_of_[p] = static_cast<int>(graph_.nodes.size());
        node.position += positionOf(p) * (1.0f / static_cast<float>(cluster.size()));
        node.radius = std::max(node.radius, distance_.at<float>(p / row_ - 1, p % row_ - 1));
      }
      graph_.nodes.push_back(node);
      members_.push_back(std::move(cluster));
    }
  }

  int nodeAt(int p) const {
    const auto found = node_of_.find(p);
    return found != node_of_.end() ? found->second : -1;
  }

  // Follows a line from pixel `p`, coming from `before`, to the next node or to its end.
  void walk(int p, int before, int node) {
    Branch branch;
    branch.begin = node;
    for (int next = p; next >= 0;) {
      p = next;
      next = -1;
      pixel_[p] = kWalked;
      branch.line.push_back(positionOf(p));
      for (const int step : around_) {
        const int q = p + step;
        if (q == before) continue;
        if (pixel_[q] == kJunction) {
          branch.end = nodeAt(q);
          next = -1;
          break;
        }
        if (pixel_[q] == kLine && next < 0) next = q;
      }
      before = p;
    }
    if (branch.begin >= 0) ++graph_.nodes[branch.begin].degree;
    if (branch.end >= 0) ++graph_.nodes[branch.end].degree;
    graph_.branches.push_back(std::move(branch));
  }

  const cv::Mat& distance_;
  cv::Mat& framed_;
  int row_ = 0;
  std::array<int, 8> around_{};
  std::uint8_t* pixel_ = nullptr;
  std::vector<int> line_pixels_, junctions_;
  std::unordered_map<int, int> node_of_;
  std::vector<std::vector<int>> members_;
  SkeletonGraph graph_;
};

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
    const float r = nearestPixel(radius, p);
    if (!(r > 0)) continue;  // Bridged gaps.
    stands_out += std::min(nearestPixel(salience, p), kMaxSalience);
    width += std::max(1.0f, r);
    ++seen;
  }
  if (seen == 0) return sums;
  const float mean = stands_out / static_cast<float>(seen);
  sums.evidence2 = mean * mean * sums.length * static_cast<float>(seen) / width;
  return sums;
}

}  // namespace

SkeletonGraph traceSkeleton(cv::Mat& framed, const cv::Mat& distance) { return Tracer(framed, distance).trace(); }

float lengthOf(const SkeletonGraph& graph, const Branch& branch) {
  float length = 0;
  for (std::size_t i = 1; i < branch.line.size(); ++i) length += distanceBetween(branch.line[i - 1], branch.line[i]);
  if (branch.line.empty()) return length;
  if (branch.begin >= 0) length += distanceBetween(graph.nodes[branch.begin].position, branch.line.front());
  if (branch.end >= 0) length += distanceBetween(branch.line.back(), graph.nodes[branch.end].position);
  if (branch.closed) length += distanceBetween(branch.line.back(), branch.line.front());
  return length;
}

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
    graph.drop(branch);
  }
}

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "skeleton_graph.hpp"

namespace angio::imaging {
namespace {

using Branch = SkeletonGraph::Branch;

// A gap is bridged if neither end turns by more than 35 deg towards the other; the side of a branch is reached by an
// end that points at it.
constexpr float kAligned = 0.82f;
constexpr float kBeyondWall = 4;     // How far from a parent's wall a side branch may begin [px].
constexpr int kDirectionReach = 10;  // Over which an end's direction is taken [px].

struct FreeEnd {
  int branch = 0;
  bool at_begin = false;
  cv::Point2f position, outwards;
  float radius = 0;
};

struct Link {
  float cost = 0;
  int a = 0, b = 0;
};

class GapClosing {
 public:
  GapClosing(SkeletonGraph& graph, const cv::Mat& radius, float max_gap, LineOwners& scratch)
      : graph_(graph), radius_(radius), max_gap_(max_gap), owners_(scratch) {}

  void run() {
    findEnds();
    joinPairs();
    findEnds();
    drawOwners();
    for (const FreeEnd& end : ends_) reachSide(end);
  }

 private:
  void findEnds() {
    ends_.clear();
    for (std::size_t b = 0; b < graph_.branches.size(); ++b) {
      const Branch& branch = graph_.branches[b];
      if (!branch.alive || branch.closed || branch.line.size() < 6) continue;
      const std::size_t far = std::min<std::size_t>(kDirectionReach, branch.line.size() - 1);
      const auto add = [&](bool at_begin, const cv::Point2f& tip, const cv::Point2f& inner) {
        const cv::Point2f chord = tip - inner;
        ends_.push_back({static_cast<int>(b), at_begin, tip,
                         chord * (1 / std::max(1e-6f, static_cast<float>(cv::norm(chord)))),
                         nearestPixel(radius_, tip)});
      };
      if (branch.begin < 0) add(true, branch.line.front(), branch.line[far]);
      if (branch.end < 0) add(false, branch.line.back(), branch.line[branch.line.size() - 1 - far]);
    }
  }

  void joinPairs() {
    std::vector<Link> links;
    for (std::size_t i = 0; i < ends_.size(); ++i) {
      for (std::size_t j = i + 1; j < ends_.size(); ++j) {
        const FreeEnd &a = ends_[i], &b = ends_[j];
        if (a.branch == b.branch) continue;
        const cv::Point2f between = b.position - a.position;
        if (std::max(std::abs(between.x), std::abs(between.y)) > max_gap_) continue;
        const float distance = static_cast<float>(cv::norm(between));
        if (distance > max_gap_ || distance < 1e-3f) continue;
        const float from = a.outwards.dot(between) / distance, to = -b.outwards.dot(between) / distance;
        // Very near ends may be a pixel or two beside each other.
        const float aligned = distance < 4 ? 0.5f : kAligned;
        if (from < aligned || to < aligned) continue;
        const float wide = std::max(a.radius, b.radius), thin = std::min(a.radius, b.radius);
        if (wide > 3 * std::max(thin, 1.0f)) continue;
        links.push_back({distance * (3 - from - to), static_cast<int>(i), static_cast<int>(j)});
      }
    }
    std::stable_sort(links.begin(), links.end(), [](const Link& a, const Link& b) { return a.cost < b.cost; });
    std::vector<char> taken(ends_.size(), 0);
    moved_.resize(graph_.branches.size());
    for (std::size_t b = 0; b < moved_.size(); ++b) moved_[b] = static_cast<int>(b);
    for (const Link& link : links) {
      if (taken[link.a] || taken[link.b]) continue;
      if (join(ends_[link.a], ends_[link.b])) taken[link.a] = taken[link.b] = 1;
    }
  }

  int current(int branch) const {
    while (moved_[branch] != branch) branch = moved_[branch];
    return branch;
  }

  // Ends are found again by their places, since joined lines change direction.
  bool join(const FreeEnd& a, const FreeEnd& b) {
    const int first_index = current(a.branch), second_index = current(b.branch);
    if (first_index == second_index) return false;
    Branch &first = graph_.branches[first_index], &second = graph_.branches[second_index];
    if (first.line.back() != a.position || first.end >= 0) first.reverse();
    if (second.line.front() != b.position || second.begin >= 0) second.reverse();
    extend(first.line, b.position);
    first.line.insert(first.line.end(), second.line.begin(), second.line.end());
    first.end = second.end;
    second.alive = false;
    moved_[second_index] = first_index;
    return true;
  }

  // Straight on to just before `to`, a pixel a step.
  static void extend(std::vector<cv::Point2f>& line, const cv::Point2f& to) {
    const cv::Point2f from = line.back();
    const int pieces = static_cast<int>(std::lround(cv::norm(to - from)));
    for (int k = 1; k < pieces; ++k) {
      line.push_back(from + (to - from) * (static_cast<float>(k) / static_cast<float>(pieces)));
    }
  }

  void drawOwners() {
    owners_.clear(radius_.size());
    for (std::size_t b = 0; b < graph_.branches.size(); ++b) draw(static_cast<int>(b));
  }

  void draw(int index) {
    const Branch& branch = graph_.branches[index];
    if (!branch.alive) return;
    for (const cv::Point2f& p : branch.line) owners_.draw(pixelOf(p), index);
  }

  void reachSide(const FreeEnd& end) {
    const Branch& own = graph_.branches[end.branch];
    if (!own.alive || (end.at_begin ? own.begin : own.end) >= 0) return;
    // A side branch begins at its parent's wall, which is a radius from the line that is looked for.
    for (float s = 2; s <= max_gap_; s += 0.7f) {
      const cv::Point2f p = end.position + s * end.outwards;
      const int hit = nearestOwner(p, end.branch);
      if (hit < 0) continue;
      if (s > kBeyondWall + 1.5f * nearestPixel(radius_, p)) return;
      attach(end, hit, p);
      return;
    }
  }

  static cv::Point pixelOf(const cv::Point2f& p) {
    return {static_cast<int>(p.x + 0.5f), static_cast<int>(p.y + 0.5f)};
  }

  int nearestOwner(const cv::Point2f& p, int own) const {
    const cv::Point middle = pixelOf(p);
    if (owners_.noneAround(middle)) return LineOwners::kNone;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int owner = owners_.at(middle + cv::Point(dx, dy));
        if (owner != LineOwners::kNone && owner != own) return owner;
      }
    }
    return LineOwners::kNone;
  }

  // Splits the branch that was hit where it was, and leads the end there.
  void attach(const FreeEnd& end, int hit, const cv::Point2f& place) {
    Branch& other = graph_.branches[hit];
    if (other.closed || other.line.size() < 3) return;
    std::size_t nearest = 0;
    for (std::size_t i = 1; i < other.line.size(); ++i) {
      if (cv::norm(other.line[i] - place) < cv::norm(other.line[nearest] - place)) nearest = i;
    }
    if (nearest == 0 || nearest + 1 >= other.line.size()) return;
    SkeletonGraph::Node node;
    node.position = other.line[nearest];
    node.radius = nearestPixel(radius_, node.position);
    node.degree = 3;
    const int index = static_cast<int>(graph_.nodes.size());
    graph_.nodes.push_back(node);
    Branch rest;
    const auto middle = other.line.begin() + static_cast<std::ptrdiff_t>(nearest);
    rest.line.assign(middle + 1, other.line.end());
    rest.begin = index;
    rest.end = other.end;
    other.line.erase(middle, other.line.end());
    other.end = index;
    Branch& own = graph_.branches[end.branch];
    if (end.at_begin) own.reverse();
    extend(own.line, node.position);
    own.end = index;
    if (end.at_begin) own.reverse();
    graph_.branches.push_back(std::move(rest));
    draw(static_cast<int>(graph_.branches.size()) - 1);
    draw(end.branch);
  }

  SkeletonGraph& graph_;
  const cv::Mat& radius_;
  float max_gap_ = 0;
  std::vector<FreeEnd> ends_;
  std::vector<int> moved_;
  LineOwners& owners_;
};

}  // namespace

void closeGaps(SkeletonGraph& graph, const cv::Mat& radius, float max_gap, LineOwners& scratch) {
  GapClosing(graph, radius, max_gap, scratch).run();
}

}  // namespace angio::imaging

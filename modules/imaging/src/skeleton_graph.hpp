// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// A graph of lines: branches between nodes (junctions) and free ends, in working pixels.
struct SkeletonGraph {
  struct Node {
    cv::Point2f position;
    float radius = 0;  ///< Largest distance to the mask's edge within the junction.
    int degree = 0;    ///< Branch ends that meet here.
    int through = -1;  ///< Branch that passes here without an end, or -1.
  };
  struct Branch {
    std::vector<cv::Point2f> line;  ///< In order; the position of a node it ends in is not part of it.
    int begin = -1;                 ///< Node, or -1 at a free end.
    int end = -1;
    bool closed = false;    ///< A ring without any node.
    bool alive = true;      ///< False once the branch was pruned or became part of another.
    bool expected = false;  ///< Not traced, but drawn where a vessel is expected.

    void reverse() {
      std::reverse(line.begin(), line.end());
      std::swap(begin, end);
    }
  };
  /// A place where one vessel passes over another, and how far the two cannot be told apart around it.
  struct Crossing {
    cv::Point2f position;
    float radius = 0;
  };
  std::vector<Node> nodes;
  std::vector<Branch> branches;
  std::vector<Crossing> crossings;

  /// Takes a branch out; its nodes lose an end.
  void drop(Branch& branch) {
    branch.alive = false;
    if (branch.begin >= 0) --nodes[branch.begin].degree;
    if (branch.end >= 0) --nodes[branch.end].degree;
  }
};

/// The pixel of an image (CV_32FC1) that is nearest to a place, which may lie beyond its edge.
inline float nearestPixel(const cv::Mat& image, const cv::Point2f& p) {
  return image.at<float>(std::clamp(static_cast<int>(p.y + 0.5f), 0, image.rows - 1),
                         std::clamp(static_cast<int>(p.x + 0.5f), 0, image.cols - 1));
}

/// What stays in the graph, in working pixels.
struct PruningRules {
  float min_branch = 0;  ///< Of a branch with a free end, from the wall of the vessel it leaves.
};

/// Orders the pixels of a one-pixel-wide skeleton (a framed mask, which is used up) into branches. Neighbouring
/// junction pixels are one node. `distance` (CV_32FC1, without the frame) is each pixel's distance to the mask's edge.
SkeletonGraph traceSkeleton(cv::Mat& framed, const cv::Mat& distance);

/// Takes away what thinning adds to a vessel: spurs, tiny rings, and the short bridge that makes two junctions of one
/// crossing. Branches that are left alone at a node become one. Removed branches are no longer `alive`.
void prune(SkeletonGraph& graph, const cv::Mat& distance, const PruningRules& rules);

/// The branch that was drawn at each pixel of an image. What was drawn is taken away again pixel by pixel: lines are
/// few of an image's pixels.
class LineOwners {
 public:
  static constexpr int kNone = -1;

  /// Nothing is drawn on an image of this size.
  void clear(const cv::Size& size) {
    if (owner_.size() == size) {
      for (const cv::Point& p : drawn_) owner_.at<int>(p) = kNone;
    } else {
      owner_.create(size, CV_32SC1);
      owner_.setTo(kNone);
    }
    drawn_.clear();
  }

  /// Draws a pixel, unless it lies beyond the edge.
  void draw(const cv::Point& p, int branch) {
    if (!contains(p)) return;
    owner_.at<int>(p) = branch;
    drawn_.push_back(p);
  }

  /// Whether nothing is drawn at a pixel and around it, as far as that does not need the edge to be looked at.
  bool noneAround(const cv::Point& p) const {
    if (p.x < 1 || p.y < 1 || p.x + 1 >= owner_.cols || p.y + 1 >= owner_.rows) return false;
    int all = kNone;  // Has all bits.
    for (int dy = -1; dy <= 1; ++dy) {
      const int* const row = owner_.ptr<int>(p.y + dy) + p.x;
      all &= row[-1] & row[0] & row[1];
    }
    return all == kNone;
  }

  /// kNone beyond the edge, too.
  int at(const cv::Point& p) const { return contains(p) ? owner_.at<int>(p) : kNone; }

 private:
  bool contains(const cv::Point& p) const { return p.x >= 0 && p.y >= 0 && p.x < owner_.cols && p.y < owner_.rows; }

  cv::Mat owner_;  // CV_32SC1
  std::vector<cv::Point> drawn_;
};

/// Joins free ends that look at each other along one line over a gap of at most `max_gap`, and a free end with the
/// side of a branch that it points at. `radius` (CV_32FC1) is the vessels' at each pixel. `scratch` is memory that may
/// be kept between calls.
void closeGaps(SkeletonGraph& graph, const cv::Mat& radius, float max_gap, LineOwners& scratch);

/// Gives each node the radius of the widest of its branches a little away from it: within a junction all scales of a
/// scale space answer.
void settleRadii(SkeletonGraph& graph, const cv::Mat& radius);

/// Makes one branch of two that go on straight where branches meet: a parent past its child, which then begins at its
/// side, and both of two vessels that cross, also where they share a stretch. `radius` as above.
void passJunctions(SkeletonGraph& graph, const cv::Mat& radius);

/// What a line must show to stay, together with the lines that it is connected with.
struct EvidenceRules {
  float evidence = 0;  ///< Mean salience times the square root of the length in vessel radii.
  float min_line = 0;  ///< [working px]
};

/// Drops connected parts of the graph that are too short or too faint for their length. `salience` and `radius`
/// (CV_32FC1) are those of each pixel.
void dropWeak(SkeletonGraph& graph, const cv::Mat& salience, const cv::Mat& radius, const EvidenceRules& rules);

/// Length of a branch from node to node or free end.
float lengthOf(const SkeletonGraph& graph, const SkeletonGraph::Branch& branch);

}  // namespace angio::imaging

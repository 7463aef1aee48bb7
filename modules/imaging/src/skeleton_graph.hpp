// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace angio {

/// A graph of lines: branches between nodes (junctions) and free ends, in working pixels.
struct SkeletonGraph {
  struct Node {
    cv::Point2f position;
    float radius = 0;  ///< Largest distance to the mask's edge within the junction.
    int degree = 0;    ///< Branch ends that meet here.
  };
  struct Branch {
    std::vector<cv::Point2f> line;  ///< In order; the position of a node it ends in is not part of it.
    int begin = -1;                 ///< Node, or -1 at a free end.
    int end = -1;
    bool closed = false;  ///< A ring without any node.
    bool alive = true;    ///< False once the branch was pruned or became part of another.
  };
  std::vector<Node> nodes;
  std::vector<Branch> branches;
};

/// What stays in the graph, in working pixels.
struct PruningRules {
  float shortest_branch = 0;  ///< Of a branch with a free end, from the wall of the vessel it leaves.
};

/// Orders the pixels of a one-pixel-wide skeleton (CV_8UC1) into branches. Neighbouring junction pixels are one node.
/// `distance` (CV_32FC1) is each pixel's distance to the mask's edge.
SkeletonGraph traceSkeleton(const cv::Mat& skeleton, const cv::Mat& distance);

/// Takes away what thinning adds to a vessel: spurs, tiny rings, and the short bridge that makes two junctions of one
/// crossing. Branches that are left alone at a node become one. Removed branches are no longer `alive`.
void prune(SkeletonGraph& graph, const cv::Mat& distance, const PruningRules& rules);

/// Length of a branch from node to node or free end.
float lengthOf(const SkeletonGraph& graph, const SkeletonGraph::Branch& branch);

}  // namespace angio

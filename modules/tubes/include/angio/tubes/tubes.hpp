// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/base/row_bands.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/tubes/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::tubes {

/// A straight tube with round ends, tapered from a to b: what a ball sweeps that moves from a to b [m] while its radius
/// goes from `radius_a_m` to `radius_b_m`, as the convex hull of both ends' balls.
struct Tube {
  Eigen::Vector3d a, b;
  double radius_a_m, radius_b_m;
  double density;  ///< Of what is in it, as a part of the full one.
};

/// A tree's edges as tubes, branch by branch, wherever its points are and however much contrast agent is there.
class TubeTree {
 public:
  /// All radii must be known.
  explicit TubeTree(const VesselTree& tree);

  /// The tubes for points that stand at 3 x N `points` [m], and a density 0..1 at each, empty for 1 everywhere. Tubes
  /// with next to nothing inside are left out. Valid until the next call.
  const std::vector<Tube>& tubes(const Eigen::Matrix3Xd& points, const Eigen::VectorXd& densities) const;

 private:
  struct Piece {
    int from, to;       // Points of the tree.
    double begin, end;  // Parts of the edge.
    double radius_begin_m, radius_end_m;
  };
  std::vector<Piece> pieces_;
  mutable std::vector<Tube> tubes_;
};

/// Sums up what the rays of a camera meet of many tubes. Keeps its buffers between calls.
class PathLengths {
 public:
  /// Metres inside the union of the tubes on the ray through each pixel's centre, CV_32FC1, weighed by density; where
  /// tubes overlap, by their mean density. Valid until the next call.
  const cv::Mat& compute(const std::vector<Tube>& tubes, const XrayCamera& camera, const Pose& T_camera_model,
                         int threads = 1);

 private:
  // Part of a pixel's ray inside vessels, from z_in to z_out. The list of a pixel holds intervals that do not touch.
  struct Interval {
    float z_in, z_out;  // Relative to origin_z_ [m].
    float density;
    std::int32_t next;
    std::int32_t pixel;
  };
  // The rows of one thread.
  struct Band {
    int top, bottom;
    std::vector<Interval> intervals;
    std::vector<float> z_in, z_out;  // One row of a tube.
  };

  void computeBand(const std::vector<Tube>& tubes, const XrayCamera& camera, const Pose& T_camera_model, Band& band);
  void add(const Tube& tube_in_camera, const XrayCamera& camera, Band& band);
  void insert(Band& band, Interval added);

  std::vector<std::int32_t> first_;  // Of each pixel, the index of its first interval or -1.
  std::vector<Band> bands_;
  double origin_z_ = 0;
  cv::Mat result_;
};

}  // namespace angio::tubes

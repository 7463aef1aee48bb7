// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio {

/// A straight tube with round ends: all points within `radius_m` of the segment from a to b [m].
struct Tube {
  Eigen::Vector3d a, b;
  double radius_m;
};

/// The tree's edges as tubes, branch by branch. All radii must be known.
std::vector<Tube> tubesOf(const VesselTree& tree);

/// Sums up what the rays of a camera meet of many tubes. Keeps its buffers between calls.
class PathLengths {
 public:
  /// Metres inside the union of the tubes on the ray through each pixel's centre, CV_32FC1. Valid until the next call.
  const cv::Mat& compute(const std::vector<Tube>& tubes, const XrayCamera& camera, const Pose& T_camera_model);

 private:
  // Part of a pixel's ray inside vessels, from z_in to z_out. The list of a pixel holds intervals that do not touch.
  struct Interval {
    float z_in, z_out;  // Relative to origin_z_ [m].
    std::int32_t next;
    std::int32_t pixel;
  };

  void add(const Tube& tube_in_camera, const XrayCamera& camera);
  void insert(std::int32_t pixel, float z_in, float z_out);

  std::vector<std::int32_t> first_;  // Of each pixel, the index of its first interval or -1.
  std::vector<Interval> intervals_;
  std::vector<float> z_in_, z_out_;  // One row of a tube.
  double origin_z_ = 0;
  cv::Mat result_;
};

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::evaluation {

/// One thing to look at in an overlay: a tree under a pose, in a colour, with its line in the legend.
struct OverlayTree {
  Pose T_camera_model = Pose::Identity();
  Eigen::Matrix3Xd displacements_m;  ///< 3 x N [m], or empty.
  cv::Scalar color_bgr;
  std::string label;
};

/// What an overlay shows.
struct OverlayScene {
  cv::Mat image;  ///< CV_8UC1 or CV_16UC1, or empty for a dark ground.
  const Centerline2d* centerline = nullptr;
  std::vector<OverlayTree> trees;
  std::string caption;  ///< Line at the bottom.
};

extern const cv::Scalar kStartColor, kModelColor, kCenterlineColor;  ///< Blue, green, red orange.

/// Draws the X-ray with the extracted centreline and projected trees, CV_8UC3 of the camera's size.
cv::Mat drawOverlay(const OverlayScene& scene, const VesselTree& tree, const XrayCamera& camera);

/// Pictures of one type from left to right, at least one; lower ones have a dark ground below.
cv::Mat sideBySide(const std::vector<cv::Mat>& pictures);

}  // namespace angio::evaluation

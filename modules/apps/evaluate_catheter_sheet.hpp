// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/localisation/tip_belief.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::apps {

/// One frame of a catheter's way, to be looked at.
struct CatheterPicture {
  Eigen::Matrix2Xd seen_px;  ///< The curve in the image, 2 x N.
  XrayCamera camera;
  Pose T_camera_model = Pose::Identity();
  TipPlace tip;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< Of the image against the pose.
  std::string caption;
};

/// Frames in rows of `columns`, each cut to what all curves need and scaled to a width of `side_px`: the tree in grey,
/// the way from its root to the tip in green, the curve in red, the tip as a ring. CV_8UC3. Needs at least one picture.
cv::Mat catheterSheet(const std::vector<CatheterPicture>& pictures, const VesselTree& tree, int columns, int side_px);

}  // namespace angio::apps

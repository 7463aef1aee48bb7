// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"
#include "residual_groups.hpp"

namespace angio::registration {

/// What one view shows of a tree, as a fit has matched it: enough to ask it again under another pose.
struct FrameEvidence {
  XrayCamera camera;
  Pose T_camera_centered = Pose::Identity();  ///< Of the fit, about the centroid.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< Mean of the fitted points, displacements included, centred.
  std::vector<ResidualGroup> groups;                 ///< About that pose, of the tree without displacement.
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::vessel {

/// The tree's centreline as the camera sees it: its projected points that fall on the detector, branch by branch. A
/// branch that leaves the detector and comes back becomes two. Bifurcation points appear once per branch that meets
/// there.
Centerline2d projectedCenterline(const VesselTree& tree, const XrayCamera& camera, const Pose& T_camera_model);

}  // namespace angio::vessel

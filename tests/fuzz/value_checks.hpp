// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/test/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::test {

/// Each throws std::logic_error when a value is not what its type's documentation says.
void checkTree(const VesselTree& tree);
void checkCenterline(const Centerline2d& line);
void checkCamera(const XrayCamera& camera);
void checkPose(const Pose& pose);
void checkFrame(const cv::Mat& frame);  ///< As an X-ray frame: 8 or 16 bits, one channel, at most 8192 px a side.

}  // namespace angio::test

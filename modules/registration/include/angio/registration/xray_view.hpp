// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/geometry/xray_camera.hpp"
#include "angio/registration/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace cv {
class Mat;
}

namespace angio::registration {

/// What one X-ray view shows. A biplane system gives two of one moment: one problem over one pose.
///
/// Borrows the centreline, the camera and the image: they must outlive the view.
struct XrayView {
  const Centerline2d& centerline;
  const XrayCamera& camera;
  Pose T_view_first =
      Pose::Identity();  ///< Camera frame of the first view in this one's: p_view = T_view_first p_first.

  /// Corners of the collimated field [px], convex, in order; empty: the whole detector is open. What lies outside has
  /// no image.
  std::vector<Eigen::Vector2d> collimator_px = {};

  /// The X-ray image, CV_8UC1 or CV_16UC1 of the detector's size, vessels dark; null where it is not at hand. Only
  /// methods that need it look at it (imageNeeded()).
  const cv::Mat* image = nullptr;

  /// Whether a pixel position lies on the detector and inside the collimator.
  bool sees(const Eigen::Vector2d& pixel) const;
};

/// The views of one moment, at least one. `camera` without a number is the first one's frame.
using XrayViews = std::vector<XrayView>;

}  // namespace angio::registration

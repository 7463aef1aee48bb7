// SPDX-License-Identifier: GPL-2.0-or-later
#include "densified_views.hpp"

#include <algorithm>

#include "angio/vessel/resample.hpp"

namespace angio::registration {

DensifiedViews::DensifiedViews(const XrayViews& given, double spacing_px) {
  for (const XrayView& view : given) {
    centerlines_.push_back(densified(view.centerline, spacing_px));
    views_.push_back({centerlines_.back(), view.camera, view.T_view_first, view.collimator_px});
  }
}

int pointsIn(const XrayViews& views) {
  int points = 0;
  for (const XrayView& view : views) points += view.centerline.size();
  return points;
}

double pixelsPerMetre(const XrayViews& views, const Eigen::Vector3d& p_camera) {
  double most = 0;
  for (const XrayView& view : views) {
    const double depth = std::max(1e-3, (view.T_view_first * p_camera).z());
    most = std::max(most, view.camera.parameters().fx_px / depth);
  }
  return most;
}

double movedAtMost_px(const XrayViews& views, const Pose& T_camera_centered, const Twist& dx, double radius_m) {
  return pixelsPerMetre(views, T_camera_centered.translation()) *
         (dx.head<3>().norm() + radius_m * dx.tail<3>().norm());
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>

#include "angio/registration/xray_view.hpp"

namespace angio::registration {

/// The views of a frame with the points of their centrelines put in equal steps.
class DensifiedViews {
 public:
  /// Borrows the cameras that the views borrow. @param spacing_px  Longest step; 0 keeps the points as they are.
  DensifiedViews(const XrayViews& given, double spacing_px);
  DensifiedViews(const DensifiedViews&) = delete;
  DensifiedViews& operator=(const DensifiedViews&) = delete;

  const XrayViews& views() const { return views_; }

 private:
  std::deque<Centerline2d> centerlines_;  // A deque's elements stay where they are.
  XrayViews views_;                       // Borrows from centerlines_.
};

/// Returns how many points the centrelines of all views have.
int pointsIn(const XrayViews& views);

/// Returns how many pixels a metre at a point of the first camera's frame is long, in the view that shows it longest.
double pixelsPerMetre(const XrayViews& views, const Eigen::Vector3d& p_camera);

/// Returns how far a step dx of T_camera_centered exp(dx) moves the projection of a tree that reaches `radius_m` from
/// its centroid: roughly, and at most [px].
double movedAtMost_px(const XrayViews& views, const Pose& T_camera_centered, const Twist& dx, double radius_m);

}  // namespace angio::registration

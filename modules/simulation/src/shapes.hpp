// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/simulation/namespace.hpp"

namespace angio::simulation {

/// A convex body in a patient: an ellipsoid, or a cylinder of elliptic section with flat ends.
struct Shape {
  enum class Kind { kEllipsoid, kCylinder };
  Kind kind = Kind::kEllipsoid;
  Eigen::Vector3d center;                              ///< [m]
  Eigen::Vector3d half_axes;                           ///< [m]; a cylinder's own axis is the third.
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< Columns are the shape's axes.
};

/// Tissue that fills a shape but for what stands in it.
struct Tissue {
  Shape shape;
  double attenuation_per_m;  ///< Linear, above what it stands in.
  std::vector<Shape> without;
};

/// A row of rays t (dx + i step, dy, 1) in the camera frame, t > 0, i from 0 on.
struct RayRow {
  double dx, step, dy;
  int count;
};

/// A shape as the rays of a camera pose meet it.
class ShapeInView {
 public:
  ShapeInView(const Shape& shape, const Pose& T_camera_body);

  /// Where each ray is inside: from depth `in` to depth `out` [m], `rays.count` of both; from 0 to 0 where it misses.
  void meet(const RayRow& rays, double* in, double* out) const;

  /// A ball around the shape, camera frame [m].
  const Eigen::Vector3d& center() const { return center_; }
  double reach_m() const { return reach_m_; }

 private:
  Shape::Kind kind_;
  Eigen::Matrix3d M_;       // Camera directions in units of the half axes.
  Eigen::Vector3d origin_;  // The source in these units, from the shape's centre.
  Eigen::Vector3d center_;
  double reach_m_;
};

}  // namespace angio::simulation

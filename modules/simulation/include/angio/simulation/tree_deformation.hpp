// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/geometry/measured_motion.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/simulation/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::simulation {

/// A displacement [m] of what is at a place [m from a tree's centroid], model axes.
using DisplacementField = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

/// Returns a measured motion carried over to a tree: turned, and scaled so that the points' extent is the tree's. A
/// displacement is that of the plane which fits those of the 40 nearest measured points best, the nearer the more.
DisplacementField carriedOver(const MeasuredMotion& motion, const VesselTree& tree, const Eigen::Matrix3d& R);

/// Returns a rotation, uniform where u, v and w are uniform in [0, 1). Source: Shoemake, Uniform random rotations,
/// Graphics Gems III (1992).
Eigen::Matrix3d uniformRotation(double u, double v, double w);

/// A deformation of a tree that holds no pose: a field less its rigid part over the tree's points (mean shift and small
/// rotation about the centroid, least squares), scaled to a size.
class TreeDeformation {
 public:
  /// @param rms_m  Of the displacements' lengths over the tree's points.
  TreeDeformation(const VesselTree& tree, DisplacementField field, double rms_m);

  /// Returns displacements of points, both 3 x N [m], model axes.
  Eigen::Matrix3Xd at(const Eigen::Matrix3Xd& points) const;

 private:
  DisplacementField field_;
  Eigen::Vector3d centroid_;
  Twist rigid_ = Twist::Zero();
  double scale_ = 1;
};

}  // namespace angio::simulation

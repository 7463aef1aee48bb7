// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>

#include "angio/evaluation/simulation.hpp"

namespace angio::evaluation {

/// The smooth deformation of a tree in one trial, at any points: plane waves, or a measured motion carried over to the
/// tree. Its rigid part (mean shift and small rotation about the centroid, least squares over the tree's points) is
/// taken out, since that would be a pose, and the rest is scaled to `settings.deformation_rms_mm`.
class TrialDeformation {
 public:
  /// @param measured  Nothing for waves.
  TrialDeformation(const VesselTree& tree, const SimulationSettings& settings, int trial,
                   const MeasuredMotion* measured);

  /// Displacements of points, both 3 x N [m], model axes.
  Eigen::Matrix3Xd at(const Eigen::Matrix3Xd& points) const;

 private:
  std::function<Eigen::Vector3d(const Eigen::Vector3d&)> raw_;  // Of a point about the centroid.
  Eigen::Vector3d centroid_;
  Twist rigid_ = Twist::Zero();
  double scale_ = 1;
};

}  // namespace angio::evaluation

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/simulation/attenuation_volume.hpp"

namespace angio::simulation {

/// The rays of a camera through a volume. Borrows it.
class VolumeRays {
 public:
  VolumeRays(const AttenuationVolume& volume, const Pose& T_camera_model);

  /// Line integral along the ray (dx, dy, 1) from the source, by steps of at most a voxel between which the
  /// attenuation is trilinear.
  float logAttenuation(double dx, double dy) const;

 private:
  float at(const Eigen::Vector3d& p) const;

  const AttenuationVolume* volume_;
  Eigen::Matrix3d M_;       // Camera directions in voxels.
  Eigen::Vector3d origin_;  // The source, in voxels.
};

}  // namespace angio::simulation

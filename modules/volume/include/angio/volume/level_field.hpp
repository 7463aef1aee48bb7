// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Distance of each voxel's centre to the nearest centre of a voxel whose `inside` is `target` (0 or 1) [m]; infinite
/// when there is none. Exact, whatever the spacing, in time linear in the voxels (Felzenszwalb and Huttenlocher,
/// "Distance transforms of sampled functions", 2012).
std::vector<float> distanceMap(const VoxelMask& mask, std::uint8_t target);

/// Signed distance of each voxel's centre to the nearest centre on the other side of the wall: positive inside [m].
/// Linear between voxels it crosses zero half-way between neighbours, and between thick slices it gives the shape
/// between them (shape-based interpolation; Raya and Udupa, 1990). The mask must have both sides.
Volume signedDistance(const VoxelMask& mask);

/// The field on voxels that are `spacing_m` [m] on all sides, linear in between. Throws InputError when that would be
/// too many voxels.
Volume isotropic(const Volume& volume, double spacing_m);

/// A field on equal voxels that is positive inside vessels and zero at their wall, looked at between voxels. Positions
/// are indices of the volume, lengths are in voxels.
class LevelField {
 public:
  /// Borrows the volume.
  explicit LevelField(const Volume& level) : level_(level) {}

  /// The field at a position, linear between voxels; beyond the volume it is outside (-1).
  double at(const Eigen::Vector3d& index) const;

  /// How far the wall is from a position inside, straight along a unit `direction` [voxels]; `farthest` when it is
  /// not nearer than that.
  double wallDistance(const Eigen::Vector3d& index, const Eigen::Vector3d& direction, double farthest) const;

  /// Where the wall crosses the lattice: 3 x N indices.
  Eigen::Matrix3Xd wallPoints() const;

 private:
  const Volume& level_;
};

}  // namespace angio::volume

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/volume/shape_settings.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// The vessels of a volume as a field that is positive inside, zero at the wall and negative outside, on the box of the
/// volume that they need.
///
/// `seeds_m` [m]: where given, only pieces that a seed lies in (or within two voxels of) are kept. Holes in the vessels
/// are filled. Throws InputError when nothing is left, or a seed lies in no vessel.
Volume vesselShape(const Volume& volume, const ShapeSettings& settings, const SelectionSettings& selection,
                   const std::vector<Eigen::Vector3d>& seeds_m);

/// The same for a mask whose inside is the vessels.
Volume vesselShape(VoxelMask mask, const SelectionSettings& selection, const std::vector<Eigen::Vector3d>& seeds_m);

/// How much each voxel looks like a bright tube, 0 to 1.
std::vector<float> vesselness(const Volume& volume, const VesselnessSettings& settings);

}  // namespace angio::volume

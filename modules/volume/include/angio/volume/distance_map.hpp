// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Distance of each voxel's centre to the nearest centre of a voxel whose `inside` is `target` (0 or 1) [m]; infinite
/// when there is none. Exact, whatever the spacing, in time linear in the voxels (Felzenszwalb and Huttenlocher,
/// "Distance transforms of sampled functions", 2012).
std::vector<float> distanceMap(const VoxelMask& mask, std::uint8_t target);

}  // namespace angio::volume

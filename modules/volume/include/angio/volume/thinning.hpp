// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// The 27 voxels around one, itself included: bit (dx + 1) + 3 (dy + 1) + 9 (dz + 1) is set when that voxel is inside.
using Neighbourhood = std::uint32_t;

/// Whether taking the middle voxel away leaves the topology as it is, with 26 neighbours inside and 6 outside: inside
/// there is just one component around it, outside just one that touches a face (Bertrand and Malandain, "A new
/// characterization of three-dimensional simple points", 1994).
bool isSimple(Neighbourhood neighbourhood);

/// The curve skeleton: simple voxels are taken away, those of the smallest `depth` first, until only simple ends of
/// curves are left. Components, tunnels and cavities stay as they are (homotopic thinning in the order of a distance
/// map; Pudney, 1998), and the curve lies where the map is highest.
///
/// `depth` has a value per voxel, any unit; what is outside the mask does not count. Deterministic.
VoxelMask thinned(const VoxelMask& mask, const std::vector<float>& depth);

/// Components minus tunnels plus cavities of the voxels inside, taken as closed cubes (so 26 neighbours touch).
long long eulerNumber(const VoxelMask& mask);

}  // namespace angio::volume

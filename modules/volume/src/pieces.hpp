// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/volume/shape_settings.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Takes away the connected pieces (26 neighbours) that the settings and seeds [m] do not want. Throws InputError when
/// a seed lies in no piece.
void selectPieces(VoxelMask& mask, const SelectionSettings& selection, const std::vector<Eigen::Vector3d>& seeds_m);

/// Takes away the pieces that hold none of the `wanted` voxels (hysteresis).
void selectTouched(VoxelMask& mask, const std::vector<std::uint8_t>& wanted);

/// Makes outside that is enclosed (6 neighbours, the volume's border is open) inside.
void fillHoles(VoxelMask& mask);

}  // namespace angio::volume

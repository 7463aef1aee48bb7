// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/io/vessel_files.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Whether a path's extension is that of a surface: .stl, .obj, .vtp, .vtk.
bool isMesh(const std::string& path);

/// Reads a surface (millimetres, in `frame`) and marks the voxels inside it, on cubes of `voxel_m` [m]. STL and legacy
/// .vtk are text or binary; points at one place are one. Open ends are closed by a flat lid. Throws InputError for
/// files that are broken, without triangles, or too large for the voxels.
VoxelMask readMesh(const std::string& path, double voxel_m, PatientFrame frame);

}  // namespace angio::volume

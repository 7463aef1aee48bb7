// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/io/vessel_files.hpp"
#include "angio/volume/repairs.hpp"
#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Whether a path's extension is that of a surface: .stl, .obj, .vtp, .vtk.
bool isMesh(const std::string& path);

/// What is inside a surface, and what had to be done to tell.
struct FilledMesh {
  VoxelMask mask;
  std::vector<Repair> repairs;  ///< Open ends, shells, normals and the like: Flaw::kOpenEnd and those after it.
};

/// Reads a surface (millimetres, in `frame`) and marks the voxels inside it, on cubes of `voxel_m` [m]. STL and legacy
/// .vtk are text or binary. Points nearer than a hundredth of a voxel are one. Open ends are closed by flat lids,
/// pieces are filled each by itself, inner walls are passed over; normals are not used. Throws InputError for files
/// that are broken, without triangles, or too large for the voxels.
FilledMesh readMesh(const std::string& path, double voxel_m, PatientFrame frame);

}  // namespace angio::volume

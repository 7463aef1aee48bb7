// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "angio/test/namespace.hpp"
#include "angio/volume/mesh_files.hpp"
#include "angio/volume/volume_files.hpp"
#include "readers.hpp"

namespace angio::test {
namespace {

constexpr double kMeshVoxel_m = 0.1;  // Coarse, so that no mesh of the largest size makes more than eight million.

void checkGrid(const VoxelGrid& grid, std::size_t values) {
  promised((grid.size.array() > 0).all() && grid.count() == values && values <= kMaxVoxels, "each voxel has a value");
  promised(grid.origin_m.allFinite() && (grid.spacing_m.array() > 0).all(), "voxels have their place");
  promised((grid.direction.transpose() * grid.direction).isIdentity(1e-9), "axes are at right angles");
}

void readAVolume(const std::string& path) {
  const Volume volume = readVolume(path);
  checkGrid(volume.grid, volume.values.size());
  promised(std::all_of(volume.values.begin(), volume.values.end(), [](float v) { return std::isfinite(v); }),
           "values are finite");
}

// The folder is the series: what is read, and a slice that stays as it is.
void readASeries(const std::string& path) { readAVolume(std::filesystem::path(path).parent_path().string()); }

void readAMesh(const std::string& path) {
  const VoxelMask mask = readMesh(path, kMeshVoxel_m, PatientFrame::kLps).mask;
  checkGrid(mask.grid, mask.inside.size());
  promised(std::all_of(mask.inside.begin(), mask.inside.end(), [](std::uint8_t v) { return v <= 1; }), "inside or not");
}

}  // namespace

std::vector<FileReader> volumeReaders() {
  return {
      {"volume_mha", "input.mha", readAVolume},
      {"volume_mhd", "input.mhd", readAVolume, {"voxels.raw", "voxels.zraw"}},
      {"volume_nii", "input.nii", readAVolume},
      {"volume_nii_gz", "input.nii.gz", readAVolume},
      {"volume_nrrd", "input.nrrd", readAVolume},
      {"volume_nhdr", "input.nhdr", readAVolume, {"voxels.raw", "voxels.zraw"}},
      {"volume_dicom", "input.dcm", readASeries, {"slice.dcm"}},
      {"mesh_stl", "input.stl", readAMesh},
      {"mesh_obj", "input.obj", readAMesh},
      {"mesh_vtp", "input.vtp", readAMesh},
      {"mesh_vtk", "input.vtk", readAMesh},
  };
}

}  // namespace angio::test

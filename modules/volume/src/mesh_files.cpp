// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/mesh_files.hpp"

#include <vtkCellArray.h>
#include <vtkFillHolesFilter.h>
#include <vtkImageData.h>
#include <vtkImageStencilData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataReader.h>
#include <vtkPolyDataToImageStencil.h>
#include <vtkSmartPointer.h>
#include <vtkTriangleFilter.h>
#include <vtkXMLPolyDataReader.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "angio/base/errors.hpp"
#include "stl_format.hpp"

namespace angio {
namespace {

constexpr std::uintmax_t kLargestMesh = std::uintmax_t{256} << 20;
constexpr std::size_t kMostMeshVoxels = std::size_t{1} << 27;

// VTK has error codes for what it would print.
class VtkSilence {
 public:
  VtkSilence() { vtkObject::GlobalWarningDisplayOff(); }
  VtkSilence(const VtkSilence&) = delete;
  VtkSilence& operator=(const VtkSilence&) = delete;
  ~VtkSilence() { vtkObject::SetGlobalWarningDisplay(before_); }

 private:
  int before_ = vtkObject::GetGlobalWarningDisplay();
};

template <typename Reader>
vtkSmartPointer<vtkPolyData> readBy(const std::string& path) {
  vtkNew<Reader> reader;
  reader->SetFileName(path.c_str());
  reader->Update();
  if (reader->GetErrorCode() != 0) return nullptr;
  return reader->GetOutput();
}

struct MeshFormat {
  const char* extension;
  vtkSmartPointer<vtkPolyData> (*read)(const std::string& path);
};

constexpr MeshFormat kFormats[] = {
    {".stl", readStl}, {".vtp", readBy<vtkXMLPolyDataReader>}, {".vtk", readBy<vtkPolyDataReader>}};

std::string extensionOf(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension;
}

// Positions in LPS; every triangle's corners are points, and every point is finite.
void check(const std::string& path, vtkPolyData& mesh, PatientFrame frame) {
  const vtkIdType points = mesh.GetNumberOfPoints();
  for (vtkIdType i = 0; i < points; ++i) {
    double p[3];
    mesh.GetPoint(i, p);
    for (int k = 0; k < 3; ++k) requireBetween(path, "point " + std::to_string(i), p[k], -1e4, 1e4);
    if (frame == PatientFrame::kRas) mesh.GetPoints()->SetPoint(i, -p[0], -p[1], p[2]);
  }
  for (vtkCellArray* cells : {mesh.GetPolys(), mesh.GetStrips()}) {
    vtkNew<vtkIdList> corners;
    for (vtkIdType c = 0; c < cells->GetNumberOfCells(); ++c) {
      cells->GetCellAtId(c, corners);
      for (vtkIdType k = 0; k < corners->GetNumberOfIds(); ++k) {
        if (corners->GetId(k) >= 0 && corners->GetId(k) < points) continue;
        throw InputError(path, "triangle " + std::to_string(c), std::to_string(corners->GetId(k)),
                         "must name points of the file");
      }
    }
  }
  if (mesh.GetPolys()->GetNumberOfCells() + mesh.GetStrips()->GetNumberOfCells() == 0) {
    throw InputError(path, "triangles", "0", "must hold a surface");
  }
}

vtkSmartPointer<vtkPolyData> closed(vtkPolyData& mesh) {
  vtkNew<vtkTriangleFilter> triangles;
  triangles->SetInputData(&mesh);
  triangles->PassVertsOff();
  triangles->PassLinesOff();
  vtkNew<vtkFillHolesFilter> lids;
  lids->SetInputConnection(triangles->GetOutputPort());
  lids->SetHoleSize(1e4);
  lids->Update();
  return lids->GetOutput();
}

}  // namespace

bool isMesh(const std::string& path) {
  const std::string extension = extensionOf(path);
  return std::any_of(std::begin(kFormats), std::end(kFormats),
                     [&](const MeshFormat& f) { return extension == f.extension; });
}

VoxelMask readMesh(const std::string& path, double voxel_m, PatientFrame frame) {
  requirePositive(path, "voxel_m", voxel_m);
  if (!std::filesystem::is_regular_file(path)) throw InputError(path, "", "", "must be a file that can be read");
  if (std::filesystem::file_size(path) > kLargestMesh) throw InputError(path, "bytes", "", "must not exceed 256 MiB");
  const VtkSilence silence;
  const std::string extension = extensionOf(path);
  const auto* format = std::find_if(std::begin(kFormats), std::end(kFormats),
                                    [&](const MeshFormat& f) { return extension == f.extension; });
  if (format == std::end(kFormats)) throw InputError(path, "extension", extension, "must be .stl, .vtp or .vtk");
  const auto mesh = format->read(path);
  if (!mesh) throw InputError(path, "", "", "cannot be read as a surface");
  check(path, *mesh, frame);
  const auto surface = closed(*mesh);

  const double voxel_mm = 1e3 * voxel_m;
  double bounds[6];
  surface->GetBounds(bounds);
  VoxelMask mask;
  mask.grid.spacing_m.setConstant(voxel_m);
  double voxels = 1;
  for (int k = 0; k < 3; ++k) {
    const double first_mm = bounds[2 * k] - voxel_mm, size = std::ceil((bounds[2 * k + 1] - first_mm) / voxel_mm) + 2;
    mask.grid.origin_m[k] = first_mm / 1e3;
    voxels *= size;
    if (voxels > static_cast<double>(kMostMeshVoxels)) {
      throw InputError(path, "voxel_mm", shown(voxel_mm),
                       "would make more than " + std::to_string(kMostMeshVoxels) + " voxels");
    }
    mask.grid.size[k] = static_cast<int>(size);
  }
  vtkNew<vtkPolyDataToImageStencil> stencil;
  stencil->SetInputData(surface);
  stencil->SetOutputOrigin((1e3 * mask.grid.origin_m).eval().data());
  stencil->SetOutputSpacing(voxel_mm, voxel_mm, voxel_mm);
  stencil->SetOutputWholeExtent(0, mask.grid.size.x() - 1, 0, mask.grid.size.y() - 1, 0, mask.grid.size.z() - 1);
  stencil->Update();
  mask.inside.assign(mask.grid.count(), 0);
  for (int z = 0; z < mask.grid.size.z(); ++z) {
    for (int y = 0; y < mask.grid.size.y(); ++y) {
      int first = 0, last = 0, next = 0;
      while (stencil->GetOutput()->GetNextExtent(first, last, 0, mask.grid.size.x() - 1, y, z, next)) {
        std::fill_n(mask.inside.begin() + static_cast<long>(mask.grid.offset({first, y, z})), last - first + 1,
                    std::uint8_t{1});
      }
    }
  }
  return mask;
}

}  // namespace angio

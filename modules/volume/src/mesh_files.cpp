// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/mesh_files.hpp"

#include <vtkCellArray.h>
#include <vtkFillHolesFilter.h>
#include <vtkImageData.h>
#include <vtkImageStencilData.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkPolyDataToImageStencil.h>
#include <vtkSmartPointer.h>
#include <vtkTriangleFilter.h>

#include <algorithm>
#include <array>
#include <map>

#include "angio/base/errors.hpp"
#include "angio/io/format_table.hpp"
#include "surface_formats.hpp"

namespace angio::volume {
namespace {

constexpr std::size_t kMaxMeshVoxels = std::size_t{1} << 27;

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

// With VTK's own readers a broken file ends the program. Points at one place become one: pieces of a surface, and
// triangles with corners of their own, are joined.
vtkSmartPointer<vtkPolyData> meshOf(const Surface& surface) {
  vtkNew<vtkPoints> points;
  std::map<std::array<double, 3>, vtkIdType> point_at;
  std::vector<vtkIdType> point_of;
  for (const Eigen::Vector3d& p_mm : surface.points_mm.colwise()) {
    const auto [place, fresh] = point_at.emplace(std::array{p_mm.x(), p_mm.y(), p_mm.z()}, points->GetNumberOfPoints());
    if (fresh) points->InsertNextPoint(p_mm.data());
    point_of.push_back(place->second);
  }
  vtkNew<vtkCellArray> polygons;
  for (const auto& polygon : surface.polygons) {
    polygons->InsertNextCell(static_cast<int>(polygon.size()));
    for (const int corner : polygon) polygons->InsertCellPoint(point_of[corner]);
  }
  const auto mesh = vtkSmartPointer<vtkPolyData>::New();
  mesh->SetPoints(points);
  mesh->SetPolys(polygons);
  return mesh;
}

struct MeshFormat {
  const char* extension;
  Surface (*read)(const std::string& path);
};

constexpr MeshFormat kMeshFormats[] = {
    {".stl", readStlSurface}, {".obj", readObjSurface}, {".vtp", readVtpSurface}, {".vtk", readVtkSurface}};

// Positions in LPS; every triangle's corners are points, and every point is finite.
void check(const std::string& path, PatientFrame frame, Surface& surface) {
  for (Eigen::Index i = 0; i < surface.points_mm.cols(); ++i) {
    for (const double x : surface.points_mm.col(i)) requireBetween(path, "point " + std::to_string(i), x, -1e4, 1e4);
  }
  if (frame == PatientFrame::kRas) surface.points_mm.topRows<2>() *= -1;
  for (std::size_t t = 0; t < surface.polygons.size(); ++t) {
    for (const int corner : surface.polygons[t]) {
      if (corner >= 0 && corner < surface.points_mm.cols()) continue;
      throw InputError(path, "triangle " + std::to_string(t), std::to_string(corner), "must name points of the file");
    }
  }
  if (surface.polygons.empty()) throw InputError(path, "triangles", "0", "must hold a surface");
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
  return std::any_of(std::begin(kMeshFormats), std::end(kMeshFormats),
                     [&](const MeshFormat& format) { return hasExtension(path, format.extension); });
}

VoxelMask readMesh(const std::string& path, double voxel_m, PatientFrame frame) {
  requirePositive(path, "voxel_m", voxel_m);
  const VtkSilence silence;
  Surface read = formatOf(path, kMeshFormats).read(path);
  check(path, frame, read);
  const auto surface = closed(*meshOf(read));

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
    if (voxels > static_cast<double>(kMaxMeshVoxels)) {
      throw InputError(path, "voxel_mm", formatValue(voxel_mm),
                       "would make more than " + std::to_string(kMaxMeshVoxels) + " voxels");
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
        std::fill_n(&mask.inside[mask.grid.offset({first, y, z})], last - first + 1, std::uint8_t{1});
      }
    }
  }
  return mask;
}

}  // namespace angio::volume

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/mesh_files.hpp"

#include <vtkCellArray.h>
#include <vtkImageData.h>
#include <vtkImageStencilData.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkPolyDataToImageStencil.h>
#include <vtkSmartPointer.h>
#include <vtkTriangleFilter.h>

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/io/format_table.hpp"
#include "closed_shells.hpp"
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

// Polygons may have any number of corners.
TriangleMesh trianglesOf(const Surface& surface) {
  TriangleMesh result;
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const Eigen::Vector3d& p_mm : surface.points_mm.colwise()) {
    points->InsertNextPoint(p_mm.data());
    result.points_mm.push_back(p_mm);
  }
  vtkNew<vtkCellArray> polygons;
  for (const auto& polygon : surface.polygons) {
    if (polygon.size() == 3) {
      result.triangles.push_back({polygon[0], polygon[1], polygon[2]});
      continue;
    }
    polygons->InsertNextCell(static_cast<int>(polygon.size()));
    for (const int corner : polygon) polygons->InsertCellPoint(corner);
  }
  vtkNew<vtkPolyData> mesh;
  mesh->SetPoints(points);
  mesh->SetPolys(polygons);
  vtkNew<vtkTriangleFilter> triangles;
  triangles->SetInputData(mesh);
  triangles->Update();
  vtkNew<vtkIdList> corners;
  vtkCellArray* const cells = triangles->GetOutput()->GetPolys();
  cells->InitTraversal();
  while (cells->GetNextCell(corners)) {
    if (corners->GetNumberOfIds() != 3) continue;
    result.triangles.push_back({static_cast<int>(corners->GetId(0)), static_cast<int>(corners->GetId(1)),
                                static_cast<int>(corners->GetId(2))});
  }
  return result;
}

vtkSmartPointer<vtkPolyData> polyDataOf(const TriangleMesh& shell) {
  vtkNew<vtkPoints> points;
  for (const Eigen::Vector3d& p_mm : shell.points_mm) points->InsertNextPoint(p_mm.data());
  vtkNew<vtkCellArray> cells;
  for (const auto& triangle : shell.triangles) {
    cells->InsertNextCell(3);
    for (const int corner : triangle) cells->InsertCellPoint(corner);
  }
  auto mesh = vtkSmartPointer<vtkPolyData>::New();
  mesh->SetPoints(points);
  mesh->SetPolys(cells);
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

// Voxels that hold the surface and one more on each side.
VoxelGrid gridAround(const std::string& path, const Eigen::Matrix3Xd& points_mm, double voxel_m) {
  const double voxel_mm = 1e3 * voxel_m;
  const Eigen::Vector3d low_mm = points_mm.rowwise().minCoeff(), high_mm = points_mm.rowwise().maxCoeff();
  VoxelGrid grid;
  grid.spacing_m.setConstant(voxel_m);
  double voxels = 1;
  for (int k = 0; k < 3; ++k) {
    const double first_mm = low_mm[k] - voxel_mm, size = std::ceil((high_mm[k] - first_mm) / voxel_mm) + 2;
    grid.origin_m[k] = first_mm / 1e3;
    voxels *= size;
    if (voxels > static_cast<double>(kMaxMeshVoxels)) {
      throw InputError(path, "voxel_mm", formatValue(voxel_mm),
                       "would make more than " + std::to_string(kMaxMeshVoxels) + " voxels");
    }
    grid.size[k] = static_cast<int>(size);
  }
  return grid;
}

// Marks the voxels inside a closed surface.
void fill(vtkPolyData& surface, VoxelMask& mask) {
  double bounds[6];
  surface.GetBounds(bounds);
  int extent[6];
  for (int k = 0; k < 3; ++k) {
    const auto indexOf = [&](double x_mm) { return (x_mm / 1e3 - mask.grid.origin_m[k]) / mask.grid.spacing_m[k]; };
    extent[2 * k] = std::max(0, static_cast<int>(std::floor(indexOf(bounds[2 * k]))) - 1);
    extent[2 * k + 1] = std::min(mask.grid.size[k] - 1, static_cast<int>(std::ceil(indexOf(bounds[2 * k + 1]))) + 1);
  }
  vtkNew<vtkPolyDataToImageStencil> stencil;
  stencil->SetInputData(&surface);
  stencil->SetOutputOrigin((1e3 * mask.grid.origin_m).eval().data());
  stencil->SetOutputSpacing((1e3 * mask.grid.spacing_m).eval().data());
  stencil->SetOutputWholeExtent(extent);
  stencil->Update();
  for (int z = extent[4]; z <= extent[5]; ++z) {
    for (int y = extent[2]; y <= extent[3]; ++y) {
      int first = 0, last = 0, next = 0;
      while (stencil->GetOutput()->GetNextExtent(first, last, extent[0], extent[1], y, z, next)) {
        std::fill_n(&mask.inside[mask.grid.offset({first, y, z})], last - first + 1, std::uint8_t{1});
      }
    }
  }
}

}  // namespace

bool isMesh(const std::string& path) {
  return std::any_of(std::begin(kMeshFormats), std::end(kMeshFormats),
                     [&](const MeshFormat& format) { return hasExtension(path, format.extension); });
}

FilledMesh readMesh(const std::string& path, double voxel_m, PatientFrame frame) {
  requirePositive(path, "voxel_m", voxel_m);
  const VtkSilence silence;
  Surface read = formatOf(path, kMeshFormats).read(path);
  check(path, frame, read);
  constexpr double kSamePoint = 0.01;  // Of a voxel: no voxel sees the difference.
  FilledMesh result;
  result.mask.grid = gridAround(path, read.points_mm, voxel_m);
  result.mask.inside.assign(result.mask.grid.count(), 0);
  ClosedShells closed = closedShells(trianglesOf(read), kSamePoint * 1e3 * voxel_m);
  for (const TriangleMesh& shell : closed.shells) fill(*polyDataOf(shell), result.mask);
  result.repairs = std::move(closed.repairs);
  return result;
}

}  // namespace angio::volume

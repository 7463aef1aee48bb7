// SPDX-License-Identifier: GPL-2.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/io/dicom_slices.hpp"
#include "angio/io/xa_files.hpp"
#include "header_checks.hpp"

namespace angio::volume {
namespace {

// A slice and how far along the normal of all slices it lies.
struct Placed {
  DicomSlice slice;
  double height_mm = 0;
};

std::vector<Placed> readSlices(const std::string& folder) {
  std::set<std::string> paths;  // In the order of their names: the same on every machine.
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) paths.insert(entry.path().string());
  if (error) throw InputError(folder, "", "", "must be a folder that can be read");
  std::vector<Placed> slices;
  std::set<std::string> series;
  std::size_t voxels = 0;
  for (const std::string& path : paths) {
    if (!isDicom(path)) continue;
    slices.push_back({readDicomSlice(path), 0});
    series.insert(slices.back().slice.series_uid);
    voxels += slices.back().slice.values.total();
    if (voxels > kMaxVoxels) {
      throw InputError(folder, "voxels", std::to_string(voxels), "must not exceed " + std::to_string(kMaxVoxels));
    }
  }
  if (series.size() != 1) {
    throw InputError(folder, "DICOM series", std::to_string(series.size()), "the folder must hold just one");
  }
  if (slices.size() < 2) throw InputError(folder, "slices", std::to_string(slices.size()), "must be at least 2");
  return slices;
}

// In their order along the normal of the image plane; the distance between them [mm].
double sortSlices(const std::string& folder, std::vector<Placed>& slices) {
  const DicomSlice first = slices.front().slice;
  const Eigen::Vector3d normal = first.right.cross(first.down);
  for (Placed& placed : slices) {
    const DicomSlice& slice = placed.slice;
    if (slice.values.size() != first.values.size() || !slice.spacing_mm.isApprox(first.spacing_mm, 1e-4) ||
        !slice.right.isApprox(first.right, 1e-3) || !slice.down.isApprox(first.down, 1e-3)) {
      throw InputError(slice.path, "slice", "", "must have the size, spacing and orientation of " + first.path);
    }
    placed.height_mm = normal.dot(slice.first_pixel_mm);
  }
  std::sort(slices.begin(), slices.end(), [](const Placed& a, const Placed& b) { return a.height_mm < b.height_mm; });
  const double step_mm = (slices.back().height_mm - slices.front().height_mm) / static_cast<double>(slices.size() - 1);
  requireBetween(folder, "slice distance_mm", step_mm, 1e-3, 1e3);
  for (std::size_t i = 1; i < slices.size(); ++i) {
    const Eigen::Vector3d expected_mm = slices.front().slice.first_pixel_mm + static_cast<double>(i) * step_mm * normal;
    // A hundredth of the distance. In the plane, slices of a tilted gantry are off: their volume is sheared.
    const double off_mm = (slices[i].slice.first_pixel_mm - expected_mm).norm();
    if (!(off_mm < 0.01 * step_mm + 1e-3)) {
      throw InputError(slices[i].slice.path, "off its place by_mm", formatValue(off_mm),
                       "slices must be evenly spaced along their normal: one is missing, doubled or sheared");
    }
  }
  return step_mm;
}

}  // namespace

Volume readDicomSeries(const std::string& folder) {
  std::vector<Placed> slices = readSlices(folder);
  const double step_mm = sortSlices(folder, slices);
  const DicomSlice& first = slices.front().slice;
  Volume volume;
  volume.grid.size = {first.values.cols, first.values.rows, static_cast<int>(slices.size())};
  volume.grid.spacing_m = Eigen::Vector3d(first.spacing_mm.x(), first.spacing_mm.y(), step_mm) / 1e3;
  volume.grid.origin_m = first.first_pixel_mm / 1e3;
  volume.grid.direction.col(0) = first.right.normalized();
  volume.grid.direction.col(2) = first.right.cross(first.down).normalized();
  volume.grid.direction.col(1) = volume.grid.direction.col(2).cross(volume.grid.direction.col(0));
  volume.values.reserve(volume.grid.count());
  for (const Placed& placed : slices) {
    const cv::Mat& values = placed.slice.values;
    for (int row = 0; row < values.rows; ++row)
      volume.values.insert(volume.values.end(), values.ptr<float>(row), values.ptr<float>(row) + values.cols);
  }
  return volume;
}

}  // namespace angio::volume

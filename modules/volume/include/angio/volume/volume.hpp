// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// No volume has more voxels: one of floats is a gibibyte.
constexpr std::size_t kMaxVoxels = std::size_t{1} << 28;

/// Where the voxels of a volume lie in the patient: DICOM's axes (L, P, S) [m], as ITK keeps them. The first index runs
/// fastest in memory.
struct VoxelGrid {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();           ///< Voxels along each axis.
  Eigen::Vector3d spacing_m = Eigen::Vector3d::Ones();      ///< Distance between their centres [m].
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();  ///< Columns: unit vectors of the axes in the patient.
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();       ///< Centre of voxel (0, 0, 0) [m].

  std::size_t count() const { return size.cast<std::size_t>().prod(); }

  /// Place of a voxel in memory.
  std::size_t offset(const Eigen::Vector3i& v) const {
    const auto row = static_cast<std::size_t>(size.x()), layer = row * static_cast<std::size_t>(size.y());
    return v.x() + row * v.y() + layer * v.z();
  }

  bool holds(const Eigen::Vector3i& v) const { return (v.array() >= 0).all() && (v.array() < size.array()).all(); }

  /// Position of an index, whole or not, in the patient [m], and back.
  Eigen::Vector3d pointAt(const Eigen::Vector3d& index) const {
    return origin_m + direction * spacing_m.cwiseProduct(index);
  }
  Eigen::Vector3d indexAt(const Eigen::Vector3d& point_m) const {
    return (direction.transpose() * (point_m - origin_m)).cwiseQuotient(spacing_m);
  }
};

/// visit(voxel, its place in memory) for all voxels of a grid of this size, in the order of memory.
template <typename Visit>
void forEachVoxel(const Eigen::Vector3i& size, const Visit& visit) {
  std::size_t at = 0;
  Eigen::Vector3i v;
  for (v.z() = 0; v.z() < size.z(); ++v.z()) {
    for (v.y() = 0; v.y() < size.y(); ++v.y()) {
      for (v.x() = 0; v.x() < size.x(); ++v.x(), ++at) visit(v, at);
    }
  }
}

/// A number per voxel.
struct Volume {
  VoxelGrid grid;
  std::vector<float> values;
};

/// What belongs to the vessels: 1 inside, 0 outside.
struct VoxelMask {
  VoxelGrid grid;
  std::vector<std::uint8_t> inside;
};

/// The box of voxels `low` to `high`, both included, widened by `margin` on all sides. Where it reaches out of the
/// volume, values are `outside`.
Volume cropped(const Volume& volume, const Eigen::Vector3i& low, const Eigen::Vector3i& high, int margin,
               float outside);

}  // namespace angio::volume

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cstring>
#include <iterator>
#include <string>
#include <vector>

#include "angio/geometry/se3.hpp"
#include "angio/test/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "angio/volume/repairs.hpp"
#include "angio/volume/volume.hpp"

namespace angio::test {

/// Distance of a point to a tree's surface, positive inside [m]: the largest R - d over its edges, radii linear between
/// points.
inline double insideBy(const VesselTree& tree, const Eigen::Vector3d& point) {
  double best = -1;
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    if (parent < 0) continue;
    const Eigen::Vector3d a = tree.points().col(parent), along = tree.points().col(i) - a;
    const double t = std::clamp(along.dot(point - a) / along.squaredNorm(), 0.0, 1.0);
    const double ra = *tree.radii()[static_cast<std::size_t>(parent)], rb = *tree.radii()[static_cast<std::size_t>(i)];
    best = std::max(best, ra + t * (rb - ra) - (a + t * along - point).norm());
  }
  return best;
}

/// A grid of anisotropic voxels about the origin, turned by an oblique rotation.
inline VoxelGrid obliqueGrid(const Eigen::Vector3i& size, const Eigen::Vector3d& spacing_m) {
  VoxelGrid grid;
  grid.size = size;
  grid.spacing_m = spacing_m;
  grid.direction = expSO3(Eigen::Vector3d(0.3, -0.5, 0.8));
  grid.origin_m = -(grid.direction * spacing_m.cwiseProduct((size.cast<double>().array() - 1).matrix() / 2));
  return grid;
}

/// The tree's tubes as an angiogram: 1000 inside, 0 outside, half a value at the wall, softened over 1 mm.
inline Volume tubes(const VesselTree& tree, const VoxelGrid& grid) {
  Volume volume{grid, std::vector<float>(grid.count())};
  std::size_t at = 0;
  for (int z = 0; z < grid.size.z(); ++z) {
    for (int y = 0; y < grid.size.y(); ++y) {
      for (int x = 0; x < grid.size.x(); ++x) {
        const double inside_mm = 1e3 * insideBy(tree, grid.pointAt(Eigen::Vector3d(x, y, z)));
        volume.values[at++] = static_cast<float>(1000 * std::clamp(0.5 + inside_mm, 0.0, 1.0));
      }
    }
  }
  return volume;
}

/// A bent trunk of radius 2.5 mm that gives off a bent branch of 1.8 mm, about 40 mm in all. Branches end as half
/// balls.
inline VesselTree bentFork() {
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  for (int i = 0; i <= 40; ++i) {  // An arc of 25 mm radius.
    const double angle = 0.04 * i - 0.8;
    points.emplace_back(25e-3 * std::cos(angle) - 20e-3, 25e-3 * std::sin(angle), 0.002 * std::sin(2 * angle));
    parents.push_back(i - 1);
    radii.emplace_back(2.5e-3);
  }
  for (int i = 1; i <= 18; ++i) {
    points.push_back(points[18] + Eigen::Vector3d(-0.6e-3 * i, 0.5e-3 * i, 0.6e-3 * i + 0.01e-3 * i * i));
    parents.push_back(i == 1 ? 18 : static_cast<int>(points.size()) - 2);
    radii.emplace_back(1.8e-3);
  }
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return {matrix, parents, radii};
}

/// The repairs of one kind.
inline std::vector<Repair> repairsOf(const std::vector<Repair>& repairs, Flaw flaw) {
  std::vector<Repair> found;
  std::copy_if(repairs.begin(), repairs.end(), std::back_inserter(found),
               [&](const Repair& repair) { return repair.flaw == flaw; });
  return found;
}

inline std::string bytesOf(const std::vector<float>& values) {
  std::string bytes(values.size() * 4, '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

inline std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.12g", value);
  return text;
}

/// A MetaImage with its voxels in it; the matrix lists the axes one after another.
inline std::string metaImage(const Volume& volume) {
  const VoxelGrid& g = volume.grid;
  std::string axes, origin, spacing, size;
  for (int i = 0; i < 3; ++i) {
    for (int row = 0; row < 3; ++row) axes += " " + number(g.direction(row, i));
    origin += " " + number(1e3 * g.origin_m[i]);
    spacing += " " + number(1e3 * g.spacing_m[i]);
    size += " " + std::to_string(g.size[i]);
  }
  return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n"
         "TransformMatrix =" +
         axes + "\nOffset =" + origin + "\nElementSpacing =" + spacing + "\nDimSize =" + size +
         "\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n" + bytesOf(volume.values);
}

/// A NIfTI-1 file whose sform says RAS.
inline std::string nifti(const Volume& volume) {
  const VoxelGrid& g = volume.grid;
  std::string header(352, '\0');
  const auto put = [&](std::size_t at, auto value) { std::memcpy(&header[at], &value, sizeof value); };
  put(0, std::int32_t{348});
  put(40, std::int16_t{3});
  for (int i = 0; i < 3; ++i) put(42 + 2 * static_cast<std::size_t>(i), static_cast<std::int16_t>(g.size[i]));
  for (std::size_t i = 4; i < 8; ++i) put(40 + 2 * i, std::int16_t{1});
  put(70, std::int16_t{16});
  put(72, std::int16_t{32});
  put(76, 1.0F);
  for (int i = 0; i < 3; ++i) put(80 + 4 * static_cast<std::size_t>(i), static_cast<float>(1e3 * g.spacing_m[i]));
  put(108, 352.0F);
  put(112, 1.0F);
  header[123] = 2;  // Millimetres.
  put(254, std::int16_t{1});
  for (int row = 0; row < 3; ++row) {
    const double sign = row < 2 ? -1e3 : 1e3;
    for (int i = 0; i < 3; ++i) {
      put(280 + 16 * static_cast<std::size_t>(row) + 4 * static_cast<std::size_t>(i),
          static_cast<float>(sign * g.direction(row, i) * g.spacing_m[i]));
    }
    put(292 + 16 * static_cast<std::size_t>(row), static_cast<float>(sign * g.origin_m[row]));
  }
  header.replace(344, 3, "n+1");
  return header + bytesOf(volume.values);
}

inline std::string nrrd(const Volume& volume) {
  const VoxelGrid& g = volume.grid;
  std::string axes, size;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = 1e3 * g.spacing_m[i] * g.direction.col(i);
    axes += " (" + number(axis.x()) + "," + number(axis.y()) + "," + number(axis.z()) + ")";
    size += " " + std::to_string(g.size[i]);
  }
  return "NRRD0004\ntype: float\ndimension: 3\nspace: left-posterior-superior\nsizes:" + size +
         "\nspace directions:" + axes +
         "\nkinds: domain domain domain\nendian: little\nencoding: raw\nspace origin: (" +
         number(1e3 * g.origin_m.x()) + "," + number(1e3 * g.origin_m.y()) + "," + number(1e3 * g.origin_m.z()) +
         ")\n\n" + bytesOf(volume.values);
}

}  // namespace angio::test

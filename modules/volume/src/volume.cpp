// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/volume.hpp"

#include <algorithm>

namespace angio::volume {

Volume cropped(const Volume& volume, const Eigen::Vector3i& low, const Eigen::Vector3i& high, int margin,
               float outside) {
  const Eigen::Vector3i first = low.array() - margin;
  Volume box;
  box.grid = volume.grid;
  box.grid.size = (high - low).array() + 1 + 2 * margin;
  box.grid.origin_m = volume.grid.pointAt(first.cast<double>());
  box.values.assign(box.grid.count(), outside);
  // The part of the box that the volume has, row by row.
  const Eigen::Vector3i from = first.cwiseMax(0);
  const Eigen::Vector3i to = (first + box.grid.size).cwiseMin(volume.grid.size);
  if ((from.array() >= to.array()).any()) return box;
  for (int z = from.z(); z < to.z(); ++z) {
    for (int y = from.y(); y < to.y(); ++y) {
      const float* const row = &volume.values[volume.grid.offset({from.x(), y, z})];
      std::copy(row, row + (to.x() - from.x()), &box.values[box.grid.offset(Eigen::Vector3i(from.x(), y, z) - first)]);
    }
  }
  return box;
}

}  // namespace angio::volume

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/measured_motion_file.hpp"

#include <vector>

#include "angio/base/errors.hpp"
#include "angio/io/table.hpp"

namespace angio::io {

MeasuredMotion readMeasuredMotion(const std::string& path) {
  constexpr std::size_t kMinCount = 20;
  std::vector<Eigen::Vector3d> from, to;
  const std::vector<std::string> columns{"x_mm", "y_mm", "z_mm", "moved_x_mm", "moved_y_mm", "moved_z_mm"};
  readTable(path, {columns, {}}, [&](const TableRow& row) {
    const auto point = [&](std::size_t first) {
      return Eigen::Vector3d(row.number(columns[first]), row.number(columns[first + 1]),
                             row.number(columns[first + 2]));
    };
    from.push_back(1e-3 * point(0));
    to.push_back(1e-3 * point(3));
  });
  if (from.size() < kMinCount) {
    throw InputError(path, "rows", std::to_string(from.size()), "must be at least " + std::to_string(kMinCount));
  }
  MeasuredMotion motion;
  motion.points.resize(3, from.size());
  motion.displacements_m.resizeLike(motion.points);
  for (std::size_t i = 0; i < from.size(); ++i) {
    motion.points.col(i) = from[i];
    motion.displacements_m.col(i) = to[i] - from[i];
  }
  const Eigen::Vector3d extent_m = motion.points.rowwise().maxCoeff() - motion.points.rowwise().minCoeff();
  if (!(extent_m.minCoeff() > 1e-3)) {
    throw InputError(path, "points", std::to_string(1e3 * extent_m.minCoeff()) + " mm apart along an axis",
                     "must reach over more than 1 mm along each axis");
  }
  return motion;
}

}  // namespace angio::io

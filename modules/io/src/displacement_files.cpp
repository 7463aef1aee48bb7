// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/displacement_files.hpp"

#include "angio/base/errors.hpp"
#include "angio/io/table.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::io {

Eigen::Matrix3Xd readDisplacements(const std::string& path, int points) {
  Eigen::Matrix3Xd result(3, points);
  int rows = 0;
  readTable(path, {{"id", "dx_mm", "dy_mm", "dz_mm"}, {}}, [&](const TableRow& row) {
    const int id = row.integer("id");
    if (rows == points) {
      throw InputError(row.place(), "id", std::to_string(id),
                       "must be the last row: the tree has " + std::to_string(points) + " points");
    }
    const Eigen::Vector3d displacement_mm{row.number("dx_mm"), row.number("dy_mm"), row.number("dz_mm")};
    result.col(rows++) = displacement_mm / 1e3;
  });
  if (rows != points) {
    throw InputError(path, "rows", std::to_string(rows),
                     "must be as many as the tree's points, " + std::to_string(points));
  }
  return result;
}

void writeDisplacements(const std::string& path, const Eigen::Matrix3Xd& displacements_m) {
  std::string content = "id,dx_mm,dy_mm,dz_mm\n";
  for (Eigen::Index i = 0; i < displacements_m.cols(); ++i) {
    content += std::to_string(i);
    for (int k = 0; k < 3; ++k) content += "," + exactMillimetres(displacements_m(k, i));
    content += "\n";
  }
  writeWholeFile(path, content);
}

}  // namespace angio::io

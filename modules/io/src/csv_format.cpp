// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/table.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"

namespace angio::io {

VesselTree readCsvTree(const std::string& path) {
  std::vector<TreeRow> rows;
  readTable(path, {{"id", "x_mm", "y_mm", "z_mm", "radius_mm", "parent"}, {}}, [&](const TableRow& from) {
    TreeRow row;
    row.line = from.line();
    row.id = from.integer("id");
    // Braces: read in order, and whole before anything is assigned.
    row.point_mm = Eigen::Vector3d{from.number("x_mm"), from.number("y_mm"), from.number("z_mm")};
    row.radius_mm = from.numberOrBlank("radius_mm");
    row.parent = from.integer("parent");
    rows.push_back(row);
  });
  return treeOfRows(path, rows);
}

void writeCsvTree(const std::string& path, const VesselTree& tree) {
  std::string content = "id,x_mm,y_mm,z_mm,radius_mm,parent\n";
  for (int i = 0; i < tree.size(); ++i) {
    content += std::to_string(i);
    for (int k = 0; k < 3; ++k) content += "," + exactMillimetres(tree.points()(k, i));
    const auto& radius = tree.radii()[static_cast<std::size_t>(i)];
    content += "," + (radius ? exactMillimetres(*radius) : "");
    content += "," + std::to_string(tree.parents()[static_cast<std::size_t>(i)]) + "\n";
  }
  writeWholeFile(path, content);
}

}  // namespace angio::io

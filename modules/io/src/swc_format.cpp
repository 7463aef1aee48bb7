// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"

namespace angio::io {

VesselTree readSwcTree(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxTextFile);
  std::vector<TreeRow> rows;
  std::vector<std::string_view> fields;
  for (TextLines lines(path, content); lines.next();) {
    splitAtBlanks(lines.text().substr(0, lines.text().find('#')), fields);
    if (fields.empty()) continue;
    const std::string place = lines.place();
    if (fields.size() != 7) {
      throw InputError(place, "columns", std::to_string(fields.size()), "must be 7: id type x y z radius parent");
    }
    TreeRow row;
    row.line = lines.number();
    row.id = parseInteger(place, "id", fields[0]);
    parseInteger(place, "type", fields[1]);
    // Braces: read in order, and whole before anything is assigned.
    row.point_mm = Eigen::Vector3d{parseNumber(place, "x_mm", fields[2]), parseNumber(place, "y_mm", fields[3]),
                                   parseNumber(place, "z_mm", fields[4])};
    row.radius_mm = knownRadius(parseNumber(place, "radius_mm", fields[5]));
    row.parent = parseInteger(place, "parent", fields[6]);
    rows.push_back(row);
    if (rows.size() > static_cast<std::size_t>(kMaxPoints)) {
      throw InputError(place, "points", std::to_string(rows.size()), "must not exceed " + std::to_string(kMaxPoints));
    }
  }
  return treeOfRows(path, rows);
}

void writeSwcTree(const std::string& path, const VesselTree& tree) {
  std::string content = "# id type x_mm y_mm z_mm radius_mm parent; radius 0 is unknown\n";
  for (int i = 0; i < tree.size(); ++i) {
    // Type 0 is "undefined": the format's types are parts of nerve cells. Ids begin at 1, as its readers expect.
    content += std::to_string(i + 1) + " 0";
    for (int k = 0; k < 3; ++k) content += " " + exactMillimetres(tree.points()(k, i));
    const auto& radius = tree.radii()[static_cast<std::size_t>(i)];
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    content +=
        " " + (radius ? exactMillimetres(*radius) : "0") + " " + std::to_string(parent < 0 ? -1 : parent + 1) + "\n";
  }
  writeWholeFile(path, content);
}

}  // namespace angio::io

// SPDX-License-Identifier: GPL-2.0-or-later
#include <unordered_map>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "tree_formats.hpp"

namespace angio::io {
namespace {

// Rows of a binary file stand on no line.
std::string placeOf(const std::string& path, const TreeRow& row) {
  return row.line > 0 ? atLine(path, row.line) : path;
}

}  // namespace

VesselTree treeOfRows(const std::string& path, const std::vector<TreeRow>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  std::unordered_map<int, int> index_of_id;
  index_of_id.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string id = std::to_string(rows[i].id);
    if (rows[i].id == -1) throw InputError(placeOf(path, rows[i]), "id", id, "-1 is the parent of a root, not an id");
    const auto [first, fresh] = index_of_id.emplace(rows[i].id, static_cast<int>(i));
    if (fresh) continue;
    const int line = rows[static_cast<std::size_t>(first->second)].line;
    throw InputError(placeOf(path, rows[i]), "id", id,
                     "must be unique, stands on line " + std::to_string(line) + " too");
  }

  Eigen::Matrix3Xd points(3, n);
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  for (const TreeRow& row : rows) {
    points.col(static_cast<Eigen::Index>(parents.size())) = row.point_mm / 1e3;
    const auto parent = index_of_id.find(row.parent);
    if (row.parent != -1 && parent == index_of_id.end()) {
      throw InputError(placeOf(path, row), "parent", std::to_string(row.parent),
                       "must be the id of a point in the file, or -1 at a root");
    }
    parents.push_back(row.parent == -1 ? -1 : parent->second);
    radii.push_back(row.radius_mm ? std::optional<double>(*row.radius_mm / 1e3) : std::nullopt);
  }

  if (const auto defect = VesselTree::findDefect(points, parents, radii)) {
    if (rows.empty()) throw InputError(atLine(path, 1), defect->field, defect->value, defect->rule);
    const TreeRow& row = rows[static_cast<std::size_t>(defect->point)];
    const bool is_parent = defect->field == "parent";  // The tree counts points, the file has ids.
    throw InputError(placeOf(path, row), defect->field, is_parent ? std::to_string(row.parent) : defect->value,
                     defect->rule);
  }
  return VesselTree(std::move(points), std::move(parents), std::move(radii));
}

std::optional<double> knownRadius(double radius_mm) {
  return radius_mm > 0 ? std::optional<double>(radius_mm) : std::nullopt;
}

}  // namespace angio::io

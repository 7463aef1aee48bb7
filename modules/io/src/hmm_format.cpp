// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"

// Centreline text of the HMM catheter tracking project (Ambrosini et al., IEEE TMI 36(3), 2017): the number of points,
// the root's index, then two lines a point: 16 numbers (position, direction, radius, ..., branch) and its neighbours.

namespace angio::io {
namespace {

struct HmmPoints {
  std::vector<TreeRow> rows;                 // Parents are found later.
  std::vector<std::vector<int>> neighbours;  // The line of a point's neighbours is the one after its own.
  int root = 0;
};

// "a;b;c;" as three parts.
void splitFields(const TextLines& lines, std::vector<std::string_view>& fields) {
  const std::string_view text = trimmed(lines.text());
  if (text.empty() || text.back() != ';') {
    const auto last = text.substr(text.find_last_of(';') + 1);
    throw InputError(lines.place(), "end of line", std::string(last), "each value must end with ';'");
  }
  splitAt(';', text.substr(0, text.size() - 1), fields);
}

TreeRow readPoint(const TextLines& lines, int index, std::vector<std::string_view>& fields) {
  static const char* const kNames[16] = {"x_mm", "y_mm", "z_mm",   "dx",     "dy",     "dz",     "radius_mm", "ox",
                                         "oy",   "oz",   "misc_1", "misc_2", "misc_3", "misc_4", "misc_5",    "branch"};
  splitFields(lines, fields);
  if (fields.size() != 16) {
    throw InputError(lines.place(), "columns", std::to_string(fields.size()), "must be 16, each followed by ';'");
  }
  double values[16];
  for (std::size_t k = 0; k < 16; ++k) values[k] = parseNumber(lines.place(), kNames[k], trimmed(fields[k]));
  TreeRow row;
  row.line = lines.number();
  row.id = index;
  row.point_mm << values[0], values[1], values[2];
  row.radius_mm = knownRadius(values[6]);
  return row;
}

std::vector<int> readNeighbours(const TextLines& lines, int index, int count, std::vector<std::string_view>& fields) {
  splitFields(lines, fields);
  std::vector<int> neighbours;
  for (const std::string_view field : fields) {
    const int neighbour = parseInteger(lines.place(), "neighbour", trimmed(field));
    const std::string value = std::to_string(neighbour);
    if (neighbour < 0 || neighbour >= count) {
      throw InputError(lines.place(), "neighbour", value, "must be a point, 0 to " + std::to_string(count - 1));
    }
    if (neighbour == index) throw InputError(lines.place(), "neighbour", value, "a point must not be its own");
    neighbours.push_back(neighbour);
  }
  std::vector<int> sorted = neighbours;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end()) {
    throw InputError(lines.place(), "neighbour", std::to_string(*twice), "must not be named twice");
  }
  return neighbours;
}

HmmPoints readHmmPoints(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxTextFile);
  TextLines lines(path, content);
  HmmPoints result;
  lines.need("points");
  const int count = parseInteger(lines.place(), "points", trimmed(lines.text()));
  requireBetween(lines.place(), "points", count, 2, kMaxPoints);
  lines.need("root");
  result.root = parseInteger(lines.place(), "root", trimmed(lines.text()));
  requireBetween(lines.place(), "root", result.root, 0, count - 1);
  std::vector<std::string_view> fields;
  for (int i = 0; i < count; ++i) {  // Nothing is reserved: the count may lie.
    lines.need("point " + std::to_string(i));
    result.rows.push_back(readPoint(lines, i, fields));
    lines.need("neighbours of point " + std::to_string(i));
    result.neighbours.push_back(readNeighbours(lines, i, count, fields));
  }
  if (lines.next()) throw InputError(lines.place(), "points", std::to_string(count), "the file has more than it says");
  return result;
}

void requireSymmetric(const std::string& path, const HmmPoints& points) {
  std::vector<std::pair<int, int>> edges;
  for (std::size_t i = 0; i < points.neighbours.size(); ++i) {
    for (const int j : points.neighbours[i]) edges.emplace_back(static_cast<int>(i), j);
  }
  std::sort(edges.begin(), edges.end());
  for (const auto& [from, to] : edges) {
    if (std::binary_search(edges.begin(), edges.end(), std::make_pair(to, from))) continue;
    throw InputError(atLine(path, points.rows[from].line + 1), "neighbour", std::to_string(to),
                     "must name point " + std::to_string(from) + " as its neighbour too");
  }
}

}  // namespace

VesselTree readHmmTree(const std::string& path) {
  HmmPoints points = readHmmPoints(path);
  requireSymmetric(path, points);
  std::vector<char> reached(points.rows.size(), 0);
  std::vector<int> open{points.root};
  reached[points.root] = 1;
  while (!open.empty()) {
    const int i = open.back();
    open.pop_back();
    const TreeRow& row = points.rows[i];
    for (const int j : points.neighbours[i]) {
      if (j == row.parent) continue;
      if (reached[j]) {
        throw InputError(atLine(path, row.line + 1), "neighbour", std::to_string(j), "the tree must not have a loop");
      }
      reached[j] = 1;
      points.rows[j].parent = i;
      open.push_back(j);
    }
  }
  const auto lost = std::find(reached.begin(), reached.end(), 0);
  if (lost != reached.end()) {
    const auto i = static_cast<std::size_t>(lost - reached.begin());
    throw InputError(atLine(path, points.rows[i].line + 1), "neighbours of point", std::to_string(i),
                     "no way leads here from the root");
  }
  return treeOfRows(path, points.rows);
}

}  // namespace angio::io

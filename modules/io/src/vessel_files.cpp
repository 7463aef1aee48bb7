// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/vessel_files.hpp"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <unordered_map>

#include "angio/base/errors.hpp"
#include "angio/io/curve_folder.hpp"
#include "angio/io/format_table.hpp"
#include "angio/io/table.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"

namespace angio::io {
namespace {

// Rows of a binary file stand on no line.
std::string placeOf(const std::string& path, const TreeRow& row) {
  return row.line > 0 ? atLine(path, row.line) : path;
}

struct CsvTree {
  std::vector<TreeRow> rows;          ///< In LPS where the file says its axes, else as they stand.
  std::optional<PatientFrame> frame;  ///< As the file says.
};

CsvTree readCsvRows(const std::string& path) {
  CsvTree read;
  readTable(path, {{"id", "x_mm", "y_mm", "z_mm", "radius_mm", "parent"}, {"frame"}}, [&](const TableRow& from) {
    TreeRow row;
    row.line = from.line();
    row.id = from.integer("id");
    // Braces: read in order, and whole before anything is assigned.
    row.point_mm = Eigen::Vector3d{from.number("x_mm"), from.number("y_mm"), from.number("z_mm")};
    row.radius_mm = from.numberOrBlank("radius_mm");
    row.parent = from.integer("parent");
    if (from.has("frame")) {
      const PatientFrame frame = frameNamed(from.place(), "frame", std::string(from.text("frame")));
      if (read.frame && frame != *read.frame)
        throw InputError(from.place(), "frame", nameOf(frame),
                         std::string("must be ") + nameOf(*read.frame) + ", as in the rows before");
      if (frame == PatientFrame::kRas) row.point_mm.head<2>() *= -1;
      read.frame = frame;
    }
    read.rows.push_back(row);
  });
  return read;
}

VesselTree readCsvTree(const std::string& path) { return treeOfRows(path, readCsvRows(path).rows); }

void writeCsvTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame> frame) {
  const std::string last = frame ? std::string(",") + nameOf(*frame) + "\n" : "\n";
  std::string content = std::string("id,x_mm,y_mm,z_mm,radius_mm,parent") + (frame ? ",frame\n" : "\n");
  for (int i = 0; i < tree.size(); ++i) {
    content += std::to_string(i);
    for (int k = 0; k < 3; ++k) content += "," + exactMillimetres(tree.points()(k, i));
    const auto& radius = tree.radii()[i];
    content += "," + (radius ? exactMillimetres(*radius) : "");
    content += "," + std::to_string(tree.parents()[i]) + last;
  }
  writeWholeFile(path, content);
}

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

void writeSwcTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame>) {
  std::string content = "# id type x_mm y_mm z_mm radius_mm parent; radius 0 is unknown\n";
  for (int i = 0; i < tree.size(); ++i) {
    // Type 0 is "undefined": the format's types are parts of nerve cells. Ids begin at 1, as its readers expect.
    content += std::to_string(i + 1) + " 0";
    for (int k = 0; k < 3; ++k) content += " " + exactMillimetres(tree.points()(k, i));
    const auto& radius = tree.radii()[i];
    const int parent = tree.parents()[i];
    content +=
        " " + (radius ? exactMillimetres(*radius) : "0") + " " + std::to_string(parent < 0 ? -1 : parent + 1) + "\n";
  }
  writeWholeFile(path, content);
}

struct TreeFormat {
  const char* extension;
  TreeReader* read;
  TreeWriter* write;  // Null for formats that are only read.
};

constexpr TreeFormat kTreeFormats[] = {
    {".csv", readCsvTree, writeCsvTree}, {".swc", readSwcTree, writeSwcTree},
    {".vtp", readVtpTree, writeVtpTree}, {".vtk", readVtkTree, nullptr},
    {".txt", readHmmTree, nullptr},      {".mrk.json", readMrkJsonTree, writeMrkJsonTree},
    {".tre", readTreTree, writeTreTree},
};

}  // namespace

PatientFrame frameNamed(const std::string& place, const std::string& field, const std::string& name) {
  for (const PatientFrame frame : {PatientFrame::kLps, PatientFrame::kRas})
    if (name == nameOf(frame)) return frame;
  throw InputError(place, field, name, "must be LPS or RAS");
}

VesselTree treeOfRows(const std::string& path, const std::vector<TreeRow>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  std::unordered_map<int, int> index_of_id;
  index_of_id.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string id = std::to_string(rows[i].id);
    if (rows[i].id == -1) throw InputError(placeOf(path, rows[i]), "id", id, "-1 is the parent of a root, not an id");
    const auto [first, fresh] = index_of_id.emplace(rows[i].id, static_cast<int>(i));
    if (fresh) continue;
    const int line = rows[first->second].line;
    throw InputError(placeOf(path, rows[i]), "id", id,
                     "must be unique, stands on line " + std::to_string(line) + " too");
  }

  Eigen::Matrix3Xd points(3, n);
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  for (const TreeRow& row : rows) {
    points.col(parents.size()) = row.point_mm / 1e3;
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
    const TreeRow& row = rows[defect->point];
    const bool is_parent = defect->field == "parent";  // The tree counts points, the file has ids.
    throw InputError(placeOf(path, row), defect->field, is_parent ? std::to_string(row.parent) : defect->value,
                     defect->rule);
  }
  return VesselTree(std::move(points), std::move(parents), std::move(radii));
}

std::optional<double> knownRadius(double radius_mm) {
  return radius_mm > 0 ? std::optional<double>(radius_mm) : std::nullopt;
}

VesselTree readVesselTree(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return joinedCurves(path, readCurveFolder(path));
  return formatOf(path, kTreeFormats).read(path);
}

bool saysItsFrame(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return true;  // Of markups.
  const auto reader = formatOf(path, kTreeFormats).read;
  return reader == readMrkJsonTree || (reader == readCsvTree && readCsvRows(path).frame);
}

VesselTree withOtherFrame(const VesselTree& tree) {
  Eigen::Matrix3Xd points_m = tree.points();
  points_m.topRows<2>() *= -1;
  return {std::move(points_m), tree.parents(), tree.radii()};
}

void writeVesselTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame> frame) {
  std::vector<TreeFormat> written;
  std::copy_if(std::begin(kTreeFormats), std::end(kTreeFormats), std::back_inserter(written),
               [](const TreeFormat& format) { return format.write != nullptr; });
  formatOf(path, written).write(path, frame == PatientFrame::kRas ? withOtherFrame(tree) : tree, frame);
}

}  // namespace angio::io

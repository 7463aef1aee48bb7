// SPDX-License-Identifier: GPL-2.0-or-later
#include <Eigen/Core>
#include <algorithm>
#include <map>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"

namespace angio::io {
namespace {

// One tube as it stands in the file: key = value lines, then its points.
struct Tube {
  int line = 0;  // Where it begins.
  int id = -1, parent_id = -1, parent_point = -1;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> transform = Eigen::Matrix3d::Identity();  // As the file's numbers run.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero(), spacing = Eigen::Vector3d::Ones();
  std::vector<std::string> columns = {"x", "y", "z", "r"};
  int points = -1;
  std::vector<TreeRow> rows;  // Ids and parents are set when tubes are linked.
};

struct KeyValue {
  std::string key;
  std::string_view value;
};

KeyValue splitKey(const TextLines& lines) {
  const auto equals = lines.text().find('=');
  if (equals == std::string_view::npos) {
    throw InputError(lines.place(), "line", std::string(trimmed(lines.text()).substr(0, 40)), "must be key = value");
  }
  return {std::string(trimmed(lines.text().substr(0, equals))), trimmed(lines.text().substr(equals + 1))};
}

template <typename Matrix>
void readNumbers(const std::string& place, const KeyValue& from, Matrix& to) {
  std::vector<std::string_view> words;
  splitAtBlanks(from.value, words);
  if (words.size() != static_cast<std::size_t>(to.size())) {
    throw InputError(place, from.key, std::to_string(words.size()),
                     "must be " + std::to_string(to.size()) + " numbers");
  }
  for (Eigen::Index i = 0; i < to.size(); ++i) {
    to(i) = requireBetween(place, from.key, parseNumber(place, from.key, words[i]), -1e6, 1e6);
  }
}

class TreReader {
 public:
  explicit TreReader(const std::string& path)
      : path_(path), content_(readWholeFile(path, kMaxTextFile)), lines_(path, content_) {}

  std::vector<Tube> tubes() {
    std::vector<Tube> tubes;
    bool in_tube = false;
    while (lines_.next()) {
      if (trimmed(lines_.text()).empty()) continue;
      const KeyValue line = splitKey(lines_);
      if (line.key == "ObjectType") {
        in_tube = line.value == "Tube" || line.value == "VesselTube";
        if (!in_tube && line.value != "Scene" && line.value != "Group") {
          throw InputError(lines_.place(), "ObjectType", std::string(line.value.substr(0, 40)),
                           "must be Tube, Group or Scene");
        }
        if (in_tube) tubes.emplace_back().line = lines_.number();
      } else if (line.key == "NDims") {
        const int dimensions = parseInteger(lines_.place(), "NDims", line.value);
        requireBetween(lines_.place(), "NDims", dimensions, 3, 3);
      } else if (in_tube) {
        readKey(line, tubes.back());
        if (line.key == "Points") in_tube = false;
      }
    }
    if (tubes.empty()) throw InputError(atLine(path_, 1), "ObjectType", "", "there must be a Tube");
    for (const Tube& tube : tubes) {
      if (tube.rows.empty()) throw InputError(atLine(path_, tube.line), "Points", "", "is missing");
    }
    return tubes;
  }

 private:
  void readKey(const KeyValue& line, Tube& tube) {
    const std::string place = lines_.place();
    if (line.key == "ID") tube.id = parseInteger(place, line.key, line.value);
    if (line.key == "ParentID") tube.parent_id = parseInteger(place, line.key, line.value);
    if (line.key == "ParentPoint") tube.parent_point = parseInteger(place, line.key, line.value);
    if (line.key == "BinaryData" && line.value != "False" && line.value != "0") {
      throw InputError(place, line.key, std::string(line.value.substr(0, 40)), "must be False: only text is read");
    }
    if (line.key == "Offset" || line.key == "Position" || line.key == "Origin") readNumbers(place, line, tube.offset);
    if (line.key == "ElementSpacing") readNumbers(place, line, tube.spacing);
    if (line.key == "TransformMatrix" || line.key == "Rotation" || line.key == "Orientation") {
      readNumbers(place, line, tube.transform);
    }
    if (line.key == "PointDim") readColumns(line, tube);
    if (line.key == "NPoints") {
      tube.points = parseInteger(place, line.key, line.value);
      requireBetween(place, line.key, tube.points, 1, kMaxPoints);
    }
    if (line.key == "Points") readPoints(tube);
  }

  void readColumns(const KeyValue& line, Tube& tube) {
    std::vector<std::string_view> words;
    splitAtBlanks(line.value, words);
    tube.columns.assign(words.begin(), words.end());
    for (const char* name : {"x", "y", "z"}) {
      if (std::count(words.begin(), words.end(), name) == 1) continue;
      throw InputError(lines_.place(), line.key, "", std::string(name) + " must be named once");
    }
  }

  void readPoints(Tube& tube) {
    if (tube.points < 0) throw InputError(lines_.place(), "NPoints", "", "is missing");
    std::vector<std::string_view> words;
    for (int i = 0; i < tube.points; ++i) {
      if (++read_ > kMaxPoints)
        throw InputError(lines_.place(), "points", "", "must not exceed " + std::to_string(kMaxPoints));
      if (!lines_.next())
        throw InputError(path_, "points", std::to_string(i), "must be " + std::to_string(tube.points));
      splitAtBlanks(lines_.text(), words);
      if (words.size() != tube.columns.size()) {
        throw InputError(lines_.place(), "columns", std::to_string(words.size()),
                         "must be " + std::to_string(tube.columns.size()) + ", as PointDim says");
      }
      TreeRow row;
      row.line = lines_.number();
      Eigen::Vector3d at;
      for (std::size_t c = 0; c < words.size(); ++c) {
        const std::string& name = tube.columns[c];
        if (name != "x" && name != "y" && name != "z" && name != "r") continue;
        const double value = parseNumber(lines_.place(), name, words[c]);
        if (name == "r") {
          row.radius_mm = knownRadius(value * tube.spacing.x());
        } else {
          at[name[0] - 'x'] = value;
        }
      }
      // ITK's offset stands for the centre of rotation, too.
      row.point_mm = tube.transform * tube.spacing.cwiseProduct(at) + tube.offset;
      tube.rows.push_back(row);
    }
  }

  const std::string& path_;
  const std::string content_;
  TextLines lines_;
  int read_ = 0;
};

// The tube and point that a tube hangs on, -1 when on none.
int parentOf(const std::string& path, const Tube& tube, const std::vector<Tube>& tubes,
             const std::map<int, std::size_t>& tube_of_id) {
  // A group or the scene may be a parent, too: then the tube is a root.
  const auto found = tube.parent_id < 0 ? tube_of_id.end() : tube_of_id.find(tube.parent_id);
  if (found == tube_of_id.end() || tube.parent_point < 0) return -1;
  const auto& rows = tubes[found->second].rows;
  if (tube.parent_point >= static_cast<int>(rows.size())) {
    throw InputError(
        atLine(path, tube.line), "ParentPoint", std::to_string(tube.parent_point),
        "must be a point of tube " + std::to_string(tube.parent_id) + ", 0 to " + std::to_string(rows.size() - 1));
  }
  return rows[tube.parent_point].id;
}

}  // namespace

VesselTree readTreTree(const std::string& path) {
  std::vector<Tube> tubes = TreReader(path).tubes();
  std::map<int, std::size_t> tube_of_id;
  int id = 0;
  for (std::size_t t = 0; t < tubes.size(); ++t) {
    if (tubes[t].id >= 0 && !tube_of_id.emplace(tubes[t].id, t).second) {
      throw InputError(atLine(path, tubes[t].line), "ID", std::to_string(tubes[t].id), "must be unique");
    }
    for (TreeRow& row : tubes[t].rows) row.id = id++;
  }
  std::map<int, int> same_as;  // A first point that repeats the point its tube hangs on.
  std::vector<TreeRow> rows;
  std::vector<int> parents;
  for (const Tube& tube : tubes) parents.push_back(parentOf(path, tube, tubes, tube_of_id));
  std::vector<Eigen::Vector3d> point_of_id(static_cast<std::size_t>(id));
  for (const Tube& tube : tubes) {
    for (const TreeRow& row : tube.rows) point_of_id[row.id] = row.point_mm;
  }
  for (std::size_t t = 0; t < tubes.size(); ++t) {
    int parent = parents[t];
    for (TreeRow& row : tubes[t].rows) {
      if (parent >= 0 && row.id != parent && row.point_mm == point_of_id[parent]) {
        same_as.emplace(row.id, parent);
        continue;
      }
      row.parent = parent;
      parent = row.id;
      rows.push_back(row);
    }
  }
  for (TreeRow& row : rows) {
    // Points that repeat one another hang together; more steps than points would be a circle.
    std::size_t steps = 0;
    for (auto same = same_as.find(row.parent); same != same_as.end() && steps <= same_as.size(); ++steps) {
      row.parent = same->second;
      same = same_as.find(row.parent);
    }
  }
  return treeOfRows(path, rows);
}

void writeTreTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame>) {
  std::map<int, std::pair<std::size_t, std::size_t>> place_of;  // Last points: tube and number in it.
  std::string content = "ObjectType = Scene\nNDims = 3\nNObjects = " + std::to_string(tree.branches().size()) + "\n";
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const auto& branch = tree.branches()[b];
    const auto parent = place_of.find(branch.front());
    content += "ObjectType = Tube\nObjectSubType = Vessel\nNDims = 3\nID = " + std::to_string(b + 1) + "\n";
    if (parent != place_of.end()) content += "ParentID = " + std::to_string(parent->second.first + 1) + "\n";
    content +=
        "BinaryData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nCenterOfRotation = 0 0 0\n"
        "ElementSpacing = 1 1 1\n";
    if (parent != place_of.end()) content += "ParentPoint = " + std::to_string(parent->second.second) + "\n";
    content += std::string("Root = ") + (parent == place_of.end() ? "True" : "False") +
               "\nArtery = True\nPointDim = id x y z r\nNPoints = " + std::to_string(branch.size()) + "\nPoints = \n";
    for (std::size_t i = 0; i < branch.size(); ++i) {
      content += std::to_string(i);
      for (int k = 0; k < 3; ++k) content += " " + exactMillimetres(tree.points()(k, branch[i]));
      const auto& radius = tree.radii()[branch[i]];
      content += " " + (radius ? exactMillimetres(*radius) : "0") + "\n";
    }
    place_of.emplace(branch.back(), std::pair(b, branch.size() - 1));
    // Several branches may begin at a root, which no branch ends at.
    place_of.emplace(branch.front(), std::pair(b, std::size_t{0}));
  }
  writeWholeFile(path, content);
}

}  // namespace angio::io

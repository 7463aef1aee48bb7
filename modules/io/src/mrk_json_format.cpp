// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <deque>
#include <map>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "tree_formats.hpp"

namespace angio::io {
namespace {

using Json = nlohmann::ordered_json;

// A number costs some bytes in the file and a hundred in memory.
constexpr std::size_t kMaxMarkups = std::size_t{64} << 20;
constexpr const char* kSchema =
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/"
    "markups-schema-v1.0.3.json#";
constexpr const char* kRadiusName = "Radius";

Json parse(const std::string& path) {
  const std::string content = readWholeFile(path, kMaxMarkups);
  try {
    return Json::parse(content);
  } catch (const Json::parse_error& error) {
    const auto end = content.begin() + static_cast<long>(std::min(error.byte, content.size()));
    throw InputError(atLine(path, 1 + static_cast<int>(std::count(content.begin(), end, '\n'))), "", "",
                     "is not valid JSON");
  } catch (const Json::exception&) {
    throw InputError(path, "", "", "is not valid JSON: a number is out of range");
  }
}

const Json& need(const std::string& path, const std::string& field, const Json& object, const char* key,
                 Json::value_t type) {
  const std::string name = field + (field.empty() ? "" : ".") + key;
  if (!object.is_object() || !object.contains(key)) throw InputError(path, name, "", "is missing");
  const Json& value = object.at(key);
  if (value.type() != type) throw InputError(path, name, value.type_name(), "must be of another type");
  return value;
}

std::string textOr(const std::string& path, const std::string& field, const Json& object, const char* key,
                   const char* otherwise) {
  return object.contains(key) ? need(path, field, object, key, Json::value_t::string).get<std::string>() : otherwise;
}

double numberOf(const std::string& path, const std::string& field, const Json& value) {
  if (!value.is_number()) throw InputError(path, field, value.type_name(), "must be a number");
  return requireFinite(path, field, value.get<double>());
}

std::vector<std::optional<double>> readMarkupRadii(const std::string& path, const std::string& field,
                                                   const Json& markup, std::size_t points) {
  std::vector<std::optional<double>> radii(points);
  if (!markup.contains("measurements")) return radii;
  for (const Json& measurement : need(path, field, markup, "measurements", Json::value_t::array)) {
    const std::string its_field = field + ".measurements";
    if (!measurement.is_object() || textOr(path, its_field, measurement, "name", "") != kRadiusName) continue;
    if (!measurement.contains("controlPointValues")) continue;
    const Json& values = need(path, its_field, measurement, "controlPointValues", Json::value_t::array);
    if (values.size() != points) {
      throw InputError(path, its_field + ".controlPointValues", std::to_string(values.size()),
                       "must be as many as control points, " + std::to_string(points));
    }
    for (std::size_t i = 0; i < points; ++i) {
      const std::string name = its_field + ".controlPointValues[" + std::to_string(i) + "]";
      radii[i] = knownRadius(numberOf(path, name, values[i]));
    }
  }
  return radii;
}

NamedCurve readCurve(const std::string& path, const std::string& field, const Json& markup) {
  NamedCurve curve;
  curve.place = path + ": " + field;
  const PatientFrame frame = frameNamed(path, field + ".coordinateSystem",
                                        textOr(path, field, markup, "coordinateSystem", nameOf(PatientFrame::kLps)));
  const std::string unit = textOr(path, field, markup, "coordinateUnits", "mm");
  if (unit != "mm") throw InputError(path, field + ".coordinateUnits", unit, "must be mm");
  const double sign = frame == PatientFrame::kRas ? -1 : 1;
  const Json& points = need(path, field, markup, "controlPoints", Json::value_t::array);
  std::vector<Eigen::Vector3d> points_mm;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::string name = field + ".controlPoints[" + std::to_string(i) + "]";
    const Json& position = need(path, name, points[i], "position", Json::value_t::array);
    if (position.size() != 3) {
      throw InputError(path, name + ".position", std::to_string(position.size()), "must be 3 numbers");
    }
    Eigen::Vector3d& point_mm = points_mm.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const std::string its_name = name + ".position[" + std::to_string(k) + "]";
      // Zero stays zero: -0 would not be found where ends are compared by their digits.
      point_mm[k] = requireBetween(path, its_name, numberOf(path, its_name, position[k]), -1e4, 1e4);
      if (k < 2 && point_mm[k] != 0) point_mm[k] *= sign;
    }
  }
  if (points.size() < 2) {
    throw InputError(path, field + ".controlPoints", std::to_string(points.size()), "a curve must have at least 2");
  }
  curve.points_mm = Eigen::Map<const Eigen::Matrix3Xd>(points_mm.front().data(), 3, points.size());
  curve.radii_mm = readMarkupRadii(path, field, markup, points.size());
  return curve;
}

// Joins curves where an end of one is a point of another.
class CurveGrowth {
 public:
  CurveGrowth(const std::string& path, std::vector<NamedCurve>& curves)
      : path_(path), curves_(curves), added_(curves.size()) {
    for (std::size_t c = 0; c < curves.size(); ++c) {
      ending_at_[positionOf(curves[c].points_mm.col(0))].push_back(c);
      ending_at_[positionOf(curves[c].points_mm.rightCols<1>())].push_back(c);
    }
  }

  std::vector<TreeRow> grown() {
    for (std::size_t c = 0; c < curves_.size(); ++c) {
      if (added_[c]) continue;
      touching_.push_back(c);
      while (!touching_.empty()) {
        const std::size_t next = touching_.front();
        touching_.pop_front();
        if (!added_[next]) add(next);
      }
    }
    return std::move(rows_);
  }

 private:
  void add(std::size_t c) {
    added_[c] = true;
    NamedCurve& curve = curves_[c];
    const Eigen::Index count = curve.points_mm.cols();
    const bool begins = row_at_.count(positionOf(curve.points_mm.col(0))) > 0,
               ends = row_at_.count(positionOf(curve.points_mm.col(count - 1))) > 0;
    if (begins && ends)
      throw InputError(curve.place, "", "", "the tree must not have a loop: both ends are on curves already");
    if (ends) {
      curve.points_mm = curve.points_mm.rowwise().reverse().eval();
      std::reverse(curve.radii_mm.begin(), curve.radii_mm.end());
    }
    int parent = -1;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::Vector3d point_mm = curve.points_mm.col(i);
      if (i > 0 && point_mm == curve.points_mm.col(i - 1)) continue;  // No edge without a length.
      const Position p = positionOf(point_mm);
      const auto [row, fresh] = row_at_.emplace(p, static_cast<int>(rows_.size()));
      if (!fresh && i > 0) {
        throw InputError(
            curve.place, "", "",
            "the tree must not have a loop: control point " + std::to_string(i) + " is on a curve already");
      }
      if (fresh) {
        if (rows_.size() == static_cast<std::size_t>(kMaxPoints)) {
          throw InputError(path_, "controlPoints", "", "must not exceed " + std::to_string(kMaxPoints));
        }
        rows_.push_back({0, row->second, point_mm, curve.radii_mm[i], parent});
        const auto here = ending_at_.find(p);
        if (here != ending_at_.end()) touching_.insert(touching_.end(), here->second.begin(), here->second.end());
      }
      parent = row->second;
    }
  }

  const std::string& path_;
  std::vector<NamedCurve>& curves_;
  std::vector<bool> added_;
  std::map<Position, std::vector<std::size_t>> ending_at_;
  std::deque<std::size_t> touching_;
  std::map<Position, int> row_at_;
  std::vector<TreeRow> rows_;
};

Json curveOf(const VesselTree& tree, const std::vector<int>& branch, std::size_t number, const char* frame) {
  Json points = Json::array(), radii = Json::array();
  for (const int i : branch) {
    Json position = Json::array();
    for (int k = 0; k < 3; ++k) position.push_back(millimetres(tree.points()(k, i)));
    points.push_back(
        {{"id", std::to_string(points.size() + 1)}, {"position", position}, {"positionStatus", "defined"}});
    const auto& radius = tree.radii()[i];
    radii.push_back(radius ? millimetres(*radius) : 0.0);
  }
  Json curve = {{"type", "Curve"},         {"coordinateSystem", frame},
                {"coordinateUnits", "mm"}, {"name", "branch " + std::to_string(number)},
                {"labelFormat", "%N-%d"},  {"lastUsedControlPointNumber", points.size()},
                {"controlPoints", points}};
  curve["measurements"] = Json::array(
      {{{"name", kRadiusName}, {"enabled", true}, {"units", "mm"}, {"controlPointValues", std::move(radii)}}});
  return curve;
}

}  // namespace

std::vector<NamedCurve> readMrkJsonCurves(const std::string& path) {
  const Json root = parse(path);
  std::vector<NamedCurve> curves;
  const Json& markups = need(path, "", root, "markups", Json::value_t::array);
  for (std::size_t m = 0; m < markups.size(); ++m) {
    const std::string field = "markups[" + std::to_string(m) + "]";
    const std::string type = need(path, field, markups[m], "type", Json::value_t::string).get<std::string>();
    if (type != "Curve") throw InputError(path, field + ".type", type.substr(0, 40), "must be Curve, which is open");
    curves.push_back(readCurve(path, field, markups[m]));
  }
  if (curves.empty()) throw InputError(path, "markups", "", "must hold at least one curve");
  return curves;
}

VesselTree readMrkJsonTree(const std::string& path) {
  std::vector<NamedCurve> curves = readMrkJsonCurves(path);
  return treeOfRows(path, CurveGrowth(path, curves).grown());
}

void writeMrkJsonTree(const std::string& path, const VesselTree& tree, std::optional<PatientFrame> frame) {
  const char* name = nameOf(frame.value_or(PatientFrame::kLps));
  Json markups = Json::array();
  for (const auto& branch : tree.branches()) markups.push_back(curveOf(tree, branch, markups.size() + 1, name));
  writeWholeFile(path, Json{{"@schema", kSchema}, {"markups", markups}}.dump(1) + "\n");
}

}  // namespace angio::io

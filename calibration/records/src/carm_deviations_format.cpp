// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/carm_deviations_format.hpp"

#include <array>

namespace angio {
namespace {

using Json = nlohmann::ordered_json;
using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

struct Field {
  const char* key;
  double CArmDeviations::*value;
  double unit;
};
constexpr std::array<Field, 10> kFields = {{
    {"primary_offset_deg", &CArmDeviations::primary_offset_rad, degToRad(1)},
    {"secondary_offset_deg", &CArmDeviations::secondary_offset_rad, degToRad(1)},
    {"axis_skew_deg", &CArmDeviations::axis_skew_rad, degToRad(1)},
    {"axis_gap_mm", &CArmDeviations::axis_gap_m, 1e-3},
    {"source_right_mm", &CArmDeviations::source_right_m, 1e-3},
    {"source_down_mm", &CArmDeviations::source_down_m, 1e-3},
    {"detector_turn_deg", &CArmDeviations::detector_turn_rad, degToRad(1)},
    {"detector_roll_deg", &CArmDeviations::detector_roll_rad, degToRad(1)},
    {"source_detector_offset_mm", &CArmDeviations::source_detector_offset_m, 1e-3},
    {"pixel_aspect", &CArmDeviations::pixel_aspect, 1},
}};

// A row: v [mm], w [deg], two frequencies, phase [deg].
constexpr int kFlexColumns = 9;
constexpr std::array<double, kFlexColumns> kFlexUnits = {1e-3,        1e-3, 1e-3, degToRad(1), degToRad(1),
                                                         degToRad(1), 1,    1,    degToRad(1)};

void readFlex(const YamlField& field, CArmFlex& flex) {
  if (field.node->kind != YamlNode::Kind::kSequence) field.refuse("must be a list of rows");
  if (field.node->items.size() > CArmFlex::kMostTerms) {
    field.refuse("must not have more than " + std::to_string(CArmFlex::kMostTerms) + " rows");
  }
  for (std::size_t i = 0; i < field.node->items.size(); ++i) {
    auto numbers = field.item(i).numbers(kFlexColumns);
    for (std::size_t k = 0; k < kFlexColumns; ++k) numbers[k] *= kFlexUnits[k];
    flex.terms[i] = {Eigen::Map<const Twist>(numbers.data()), numbers[6], numbers[7], numbers[8]};
  }
  flex.count = static_cast<int>(field.node->items.size());
}

Json flexAsJson(const CArmFlex& flex) {
  Json rows = Json::array();
  for (int i = 0; i < flex.count; ++i) {
    const CArmFlexTerm& term = flex.terms[static_cast<std::size_t>(i)];
    Json row = Json::array();
    for (std::size_t k = 0; k < 6; ++k) row.push_back(term.twist[static_cast<Eigen::Index>(k)] / kFlexUnits[k]);
    row.push_back(term.frequency_primary);
    row.push_back(term.frequency_secondary);
    row.push_back(radToDeg(term.phase_rad));
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

void readCArmDeviations(const YamlField& section, CArmDeviations& d) {
  YamlMap map(section.path, *section.node, section.key);
  for (const Field& field : kFields) {
    if (const auto given = map.find(field.key)) d.*field.value = field.unit * given->number();
  }
  if (const auto given = map.find("table")) d.table = Eigen::Map<const RowMajor3d>(given->numbers(9).data());
  if (const auto given = map.find("principal_point_px")) {
    d.principal_point_px = Eigen::Map<const Eigen::Vector2d>(given->numbers(2).data());
  }
  if (const auto given = map.find("principal_point_slope_px_per_mm")) {
    d.principal_point_slope_px_per_m = 1e3 * Eigen::Map<const Eigen::Vector2d>(given->numbers(2).data());
  }
  if (const auto given = map.find("flex")) readFlex(*given, d.flex);
  map.refuseOthers();
}

Json carmDeviationsAsJson(const CArmDeviations& d) {
  Json json = Json::object();
  for (const Field& field : kFields) {
    if (d.*field.value != 0) json[field.key] = d.*field.value / field.unit;
  }
  if (!d.table.isIdentity(0)) {
    for (int i = 0; i < 9; ++i) json["table"].push_back(d.table(i / 3, i % 3));
  }
  const auto pair = [&](const char* key, const Eigen::Vector2d& values) {
    if (!values.isZero(0)) json[key] = {values.x(), values.y()};
  };
  pair("principal_point_px", d.principal_point_px);
  pair("principal_point_slope_px_per_mm", 1e-3 * d.principal_point_slope_px_per_m);
  if (d.flex.count > 0) json["flex"] = flexAsJson(d.flex);
  return json;
}

}  // namespace angio

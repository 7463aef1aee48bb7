// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/carm_calibration.hpp"

#include <array>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/calibration_records/centered_carm.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/pose_files.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::calibration_records {
namespace {

using Json = nlohmann::ordered_json;
using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

void requireRotation(const std::string& place, const std::string& field, const Eigen::Matrix3d& M) {
  const double defect = rotationDefect(M);
  if (!(defect < 1e-3))
    throw InputError(place, field, "R^T R - I up to " + formatValue(defect), "must be a rotation matrix");
}

int readSize(const YamlField& field, double size) {
  requireBetween(field.place(), field.key, size, 1, 32768);
  if (size != static_cast<int>(size))
    throw InputError(field.place(), field.key, formatValue(size), "must be a whole number");
  return static_cast<int>(size);
}

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
  const std::vector<YamlField> rows = field.items("must be a list of rows");
  if (rows.size() > CArmFlex::kMaxTerms) {
    field.refuse("must not have more than " + std::to_string(CArmFlex::kMaxTerms) + " rows");
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    auto numbers = rows[i].numbers(kFlexColumns);
    for (std::size_t k = 0; k < kFlexColumns; ++k) numbers[k] *= kFlexUnits[k];
    flex.terms[i] = {Eigen::Map<const Twist>(numbers.data()), numbers[6], numbers[7], numbers[8]};
  }
  flex.count = static_cast<int>(rows.size());
}

Json flexAsJson(const CArmFlex& flex) {
  Json rows = Json::array();
  for (int i = 0; i < flex.count; ++i) {
    const CArmFlexTerm& term = flex.terms[i];
    Json row = Json::array();
    for (std::size_t k = 0; k < 6; ++k) row.push_back(term.twist[k] / kFlexUnits[k]);
    row.push_back(term.frequency_primary);
    row.push_back(term.frequency_secondary);
    row.push_back(radToDeg(term.phase_rad));
    rows.push_back(row);
  }
  return rows;
}

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
  if (!d.table.isIdentity(0)) json["table"] = matrixAsJson(d.table);
  if (!d.principal_point_px.isZero(0)) json["principal_point_px"] = matrixAsJson(d.principal_point_px);
  if (!d.principal_point_slope_px_per_m.isZero(0)) {
    json["principal_point_slope_px_per_mm"] = matrixAsJson(1e-3 * d.principal_point_slope_px_per_m);
  }
  if (d.flex.count > 0) json["flex"] = flexAsJson(d.flex);
  return json;
}

}  // namespace

void CArmCalibration::check(const std::string& place) const {
  try {
    carm.check();
  } catch (const InputError& error) {
    throw error.within(place);
  }
  requireRotation(place, "T_dsa_cb.rotation", T_dsa_cb.linear());
  for (const double x : T_dsa_cb.translation()) requireFinite(place, "T_dsa_cb.translation_mm", 1e3 * x);
  requireRotation(place, "R_lps_model", R_lps_model);
}

CArmFile readCArmFile(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "C-arm");
  CArmFile file;
  CArmGeometry& carm = file.carm;
  carm.source_isocenter_distance_m = 1e-3 * map.need("source_isocentre_distance_mm").between(1, 10000);
  carm.source_detector_distance_m = 1e-3 * map.need("source_detector_distance_mm").between(1, 10000);
  carm.pixel_spacing_m = 1e-3 * map.need("pixel_spacing_mm").between(1e-4, 100);
  const YamlField size = map.need("image_size_px");
  const auto sizes = size.numbers(2);
  carm.image_width_px = readSize(size, sizes[0]);
  carm.image_height_px = readSize(size, sizes[1]);
  if (const auto field = map.find("l_arm_deg")) carm.l_arm_rad = degToRad(field->number());
  if (const auto field = map.find("T_dsa_cb")) file.T_dsa_cb = readPoseField(path, *field, nullptr);
  if (const auto field = map.find("R_lps_model")) file.R_lps_model = readRotation(*field);
  if (const auto field = map.find("model_id")) file.model_id = readModelId(*field);
  if (const auto field = map.find("machine")) file.machine = field->text();
  if (const auto field = map.find("deviations")) readCArmDeviations(*field, carm.deviations);
  if (const auto field = map.find("calibration")) file.records = readRecords(*field);
  map.refuseOthers();
  try {
    carm.check();
  } catch (const InputError& error) {
    throw error.within(path);
  }
  return file;
}

void writeCArmFile(const std::string& path, const CArmFile& file) {
  Json json;
  if (!file.machine.empty()) json["machine"] = file.machine;
  json["source_isocentre_distance_mm"] = file.carm.source_isocenter_distance_m * 1e3;
  json["source_detector_distance_mm"] = file.carm.source_detector_distance_m * 1e3;
  json["pixel_spacing_mm"] = file.carm.pixel_spacing_m * 1e3;
  json["image_size_px"] = {file.carm.image_width_px, file.carm.image_height_px};
  if (file.carm.l_arm_rad != 0) json["l_arm_deg"] = radToDeg(file.carm.l_arm_rad);
  const Json deviations = carmDeviationsAsJson(file.carm.deviations);
  if (!deviations.empty()) json["deviations"] = deviations;
  if (file.T_dsa_cb) json["T_dsa_cb"] = poseAsJson(*file.T_dsa_cb);
  if (file.model_id != ModelId::kUnknown) json["model_id"] = static_cast<std::int64_t>(file.model_id);
  if (!file.R_lps_model.isIdentity(0)) json["R_lps_model"] = matrixAsJson(file.R_lps_model);
  for (const auto& record : file.records) json["calibration"][record.kind] = recordAsJson(record);
  writeWholeFile(path, asYaml(json));
}

CArmCalibration readCArmCalibration(const std::string& path) {
  CArmFile file = readCArmFile(path);
  if (!file.T_dsa_cb) {
    throw InputError(path, "T_dsa_cb", "",
                     "is missing: angio-calibrate hand-eye or angio-calibrate registration makes it; in a simulation "
                     "--t-dsa-cb centre does without");
  }
  return {file.carm, *file.T_dsa_cb, file.R_lps_model, file.machine, std::move(file.records), file.model_id};
}

CArmCalibration readCArmCalibration(const std::string& path, const VesselTree& tree) {
  CArmCalibration calibration = readCArmCalibration(path);
  requireTree(path, calibration.model_id, tree,
              ": T_dsa_cb is of another tree. Calibrate with this one, leave model_id out where both trees are in one "
              "frame, or in a simulation give --t-dsa-cb centre");
  return calibration;
}

CArmCalibration readCenteredCArm(const std::string& path, const Eigen::Vector3d& centroid_model) {
  CArmFile file = readCArmFile(path);
  return {file.carm, centeredInPatient(centroid_model), Eigen::Matrix3d::Identity(), file.machine,
          std::move(file.records)};
}

Pose centeredInPatient(const Eigen::Vector3d& centroid_model) {
  Pose T_dsa_cb = Pose::Identity();
  T_dsa_cb.translation() = -centroid_model;
  return T_dsa_cb;
}

void writeCArmCalibration(const std::string& path, const CArmCalibration& c) {
  writeCArmFile(path, {c.carm, c.T_dsa_cb, c.R_lps_model, c.machine, c.records, c.model_id});
}

CArmCalibration miscalibrated(const CArmCalibration& truth, const Eigen::Vector3d& center_model,
                              const Eigen::Vector3d& axis_patient, double angle_rad,
                              const Eigen::Vector3d& shift_patient_m) {
  CArmCalibration wrong = truth;
  const Eigen::Vector3d center_patient = truth.T_dsa_cb * center_model;
  wrong.T_dsa_cb.linear() = expSO3(axis_patient.normalized() * angle_rad) * truth.T_dsa_cb.linear();
  wrong.T_dsa_cb.translation() = center_patient + shift_patient_m - wrong.T_dsa_cb.linear() * center_model;
  return wrong;
}

}  // namespace angio::calibration_records

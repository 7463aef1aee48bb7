// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/carm_calibration.hpp"

#include "angio/base/errors.hpp"
#include "angio/calibration_records/carm_deviations_format.hpp"
#include "angio/io/whole_file.hpp"

namespace angio {
namespace {

using Json = nlohmann::ordered_json;
using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Eigen::Matrix3d requireRotation(const std::string& place, const std::string& field, const Eigen::Matrix3d& M) {
  const double defect = rotationDefect(M);
  if (!(defect < 1e-3)) throw InputError(place, field, "R^T R - I up to " + shown(defect), "must be a rotation matrix");
  return nearestRotation(M);
}

Eigen::Matrix3d readRotation(const YamlField& field, const std::string& name) {
  return requireRotation(field.place(), name, Eigen::Map<const RowMajor3d>(field.numbers(9).data()));
}

Pose readPatient(const YamlField& field) {
  YamlMap map(field.path, *field.node, field.key);
  Pose T = Pose::Identity();
  // Named in full: a file that lacks one of them shall say which.
  const auto rotation = map.find("rotation"), translation = map.find("translation_mm");
  if (!rotation) throw InputError(field.place(), "T_dsa_cb.rotation", "", "is missing");
  if (!translation) throw InputError(field.place(), "T_dsa_cb.translation_mm", "", "is missing");
  T.linear() = readRotation(*rotation, "T_dsa_cb.rotation");
  const auto mm = translation->numbers(3);
  for (std::size_t i = 0; i < 3; ++i) {
    requireBetween(translation->place(), "T_dsa_cb.translation_mm", mm[i], -1e5, 1e5);
    T.translation()[static_cast<Eigen::Index>(i)] = 1e-3 * mm[i];
  }
  map.refuseOthers();
  return T;
}

double readLength(YamlMap& map, const std::string& key, double low, double high) {
  const YamlField field = map.need(key);
  return requireBetween(field.place(), key, field.number(), low, high);
}

int readSize(const YamlField& field, double size) {
  requireBetween(field.place(), field.key, size, 1, 32768);
  if (size != static_cast<int>(size)) throw InputError(field.place(), field.key, shown(size), "must be a whole number");
  return static_cast<int>(size);
}

Json numbersOf(const Eigen::Matrix3d& M) {
  Json numbers = Json::array();
  for (int i = 0; i < 9; ++i) numbers.push_back(M(i / 3, i % 3));
  return numbers;
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
  carm.source_isocentre_distance_m = 1e-3 * readLength(map, "source_isocentre_distance_mm", 1, 10000);
  carm.source_detector_distance_m = 1e-3 * readLength(map, "source_detector_distance_mm", 1, 10000);
  carm.pixel_spacing_m = 1e-3 * readLength(map, "pixel_spacing_mm", 1e-4, 100);
  const YamlField size = map.need("image_size_px");
  const auto sizes = size.numbers(2);
  carm.image_width_px = readSize(size, sizes[0]);
  carm.image_height_px = readSize(size, sizes[1]);
  if (const auto field = map.find("l_arm_deg")) carm.l_arm_rad = degToRad(field->number());
  if (const auto field = map.find("T_dsa_cb")) file.T_dsa_cb = readPatient(*field);
  if (const auto field = map.find("R_lps_model")) file.R_lps_model = readRotation(*field, "R_lps_model");
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
  json["source_isocentre_distance_mm"] = file.carm.source_isocentre_distance_m * 1e3;
  json["source_detector_distance_mm"] = file.carm.source_detector_distance_m * 1e3;
  json["pixel_spacing_mm"] = file.carm.pixel_spacing_m * 1e3;
  json["image_size_px"] = {file.carm.image_width_px, file.carm.image_height_px};
  if (file.carm.l_arm_rad != 0) json["l_arm_deg"] = radToDeg(file.carm.l_arm_rad);
  const Json deviations = carmDeviationsAsJson(file.carm.deviations);
  if (!deviations.empty()) json["deviations"] = deviations;
  if (file.T_dsa_cb) {
    const Eigen::Vector3d mm = 1e3 * file.T_dsa_cb->translation();
    json["T_dsa_cb"] = {{"rotation", numbersOf(file.T_dsa_cb->linear())}, {"translation_mm", {mm.x(), mm.y(), mm.z()}}};
  }
  if (!file.R_lps_model.isIdentity(0)) json["R_lps_model"] = numbersOf(file.R_lps_model);
  for (const auto& record : file.records) json["calibration"][record.kind] = recordAsJson(record);
  writeWholeFile(path, asYaml(json));
}

CArmCalibration readCArmCalibration(const std::string& path) {
  CArmFile file = readCArmFile(path);
  if (!file.T_dsa_cb) {
    throw InputError(path, "T_dsa_cb", "",
                     "is missing: angio-calibrate hand-eye or angio-calibrate registration makes it");
  }
  return {file.carm, *file.T_dsa_cb, file.R_lps_model, file.machine, std::move(file.records)};
}

void writeCArmCalibration(const std::string& path, const CArmCalibration& c) {
  writeCArmFile(path, {c.carm, c.T_dsa_cb, c.R_lps_model, c.machine, c.records});
}

CArmCalibration miscalibrated(const CArmCalibration& truth, const Eigen::Vector3d& centre_model,
                              const Eigen::Vector3d& axis_patient, double angle_rad,
                              const Eigen::Vector3d& shift_patient_m) {
  CArmCalibration wrong = truth;
  const Eigen::Vector3d centre_patient = truth.T_dsa_cb * centre_model;
  wrong.T_dsa_cb.linear() = expSO3(axis_patient.normalized() * angle_rad) * truth.T_dsa_cb.linear();
  wrong.T_dsa_cb.translation() = centre_patient + shift_patient_m - wrong.T_dsa_cb.linear() * centre_model;
  return wrong;
}

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/record.hpp"

#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/calibration_records/pose_fields.hpp"
#include "angio/io/whole_file.hpp"

namespace angio::calibration_records {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::system_clock;

const std::set<std::string> kKinds = {"camera", "geometry", "hand_eye", "registration"};

constexpr const char* kDateFormat = "%Y-%m-%dT%H:%M:%SZ";

std::string dateOf(std::time_t time) {
  std::tm utc{};
  gmtime_r(&time, &utc);
  char text[32];
  std::strftime(text, sizeof text, kDateFormat, &utc);
  return text;
}

std::optional<Clock::time_point> timeOf(const std::string& date) {
  std::tm utc{};
  if (!strptime(date.c_str(), kDateFormat, &utc)) return std::nullopt;
  const std::time_t time = timegm(&utc);
  if (dateOf(time) != date) return std::nullopt;  // The 31st of February would become a day of March.
  return Clock::from_time_t(time);
}

Json rowsOf(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) rows.push_back(matrixAsJson(matrix.row(r)));
  return rows;
}

Eigen::MatrixXd readRecordCovariance(const YamlField& field, std::size_t size) {
  const std::vector<YamlField> rows = field.items("must be a list");
  if (rows.size() != size) field.refuse("must be " + std::to_string(size) + " rows, one per parameter");
  Eigen::MatrixXd covariance(size, size);
  for (std::size_t r = 0; r < size; ++r) {
    covariance.row(r) = Eigen::Map<const Eigen::RowVectorXd>(rows[r].numbers(size).data(), size);
  }
  return requireCovariance(field, covariance, Definiteness::kSemi);
}

CalibrationInput readInput(const YamlField& field) {
  YamlMap map(field.path, *field.node, field.key);
  CalibrationInput input{map.need("file").text(), map.need("sha256").text()};
  if (input.sha256.size() != 64 || input.sha256.find_first_not_of("0123456789abcdef") != std::string::npos) {
    map.need("sha256").refuse("must be 64 hexadecimal digits");
  }
  map.refuseOthers();
  return input;
}

ViewResidual readView(const YamlField& field) {
  YamlMap map(field.path, *field.node, field.key);
  ViewResidual view;
  view.name = map.need("name").text();
  view.points = map.need("points").integer();
  view.rms = map.need("rms").number();
  if (const auto outlier = map.find("outlier")) view.outlier = outlier->flag();
  map.refuseOthers();
  return view;
}

WeakDirection readWeak(const YamlField& field) {
  YamlMap map(field.path, *field.node, field.key);
  WeakDirection weak{map.need("name").text(), map.need("sigma").number(), ""};
  if (const auto unit = map.find("unit")) weak.unit = unit->text();
  map.refuseOthers();
  return weak;
}

template <typename Item>
std::vector<Item> listOf(YamlMap& map, const char* key, Item (*read)(const YamlField&)) {
  std::vector<Item> items;
  if (const auto list = map.find(key)) {
    for (const YamlField& item : list->items("must be a list")) items.push_back(read(item));
  }
  return items;
}

CalibrationRecord readRecord(const std::string& path, const std::string& kind, const YamlNode& node) {
  YamlMap map(path, node, "calibration." + kind);
  CalibrationRecord record;
  record.kind = kind;
  record.date = map.need("date").text();
  if (!timeOf(record.date)) map.need("date").refuse("must be a date as 2026-01-31T12:00:00Z");
  if (const auto machine = map.find("machine")) record.machine = machine->text();
  record.inputs = listOf(map, "inputs", readInput);
  for (const YamlField& name : map.need("parameters").items("must be a list")) record.parameters.push_back(name.text());
  const std::vector<double> values = map.need("values").numbers(record.parameters.size());
  record.values = Eigen::Map<const Eigen::VectorXd>(values.data(), values.size());
  record.covariance = readRecordCovariance(map.need("covariance"), record.parameters.size());
  record.condition = map.need("condition").positive();
  record.weak_directions = listOf(map, "weak_directions", readWeak);
  record.residual_unit = map.need("residual_unit").text();
  record.residual_rms = map.need("residual_rms").number();
  if (const auto held_out = map.find("held_out_rms")) record.held_out_rms = held_out->number();
  record.views = listOf(map, "views", readView);
  map.refuseOthers();
  return record;
}

}  // namespace

std::optional<Eigen::Index> CalibrationRecord::placeOf(const std::string& parameter) const {
  const auto found = std::find(parameters.begin(), parameters.end(), parameter);
  if (found == parameters.end()) return std::nullopt;
  return found - parameters.begin();
}

double CalibrationRecord::sigma(const std::string& parameter) const {
  const auto place = placeOf(parameter);
  if (!place) throw InputError("calibration." + kind, parameter, "", "is no parameter of it");
  return std::sqrt(covariance(*place, *place));
}

Json recordAsJson(const CalibrationRecord& record) {
  Json json;
  json["date"] = record.date;
  if (!record.machine.empty()) json["machine"] = record.machine;
  json["inputs"] = Json::array();
  for (const CalibrationInput& input : record.inputs) {
    json["inputs"].push_back({{"file", input.path}, {"sha256", input.sha256}});
  }
  json["parameters"] = record.parameters;
  json["values"] = std::vector<double>(record.values.begin(), record.values.end());
  json["covariance"] = rowsOf(record.covariance);
  json["condition"] = record.condition;
  json["weak_directions"] = Json::array();
  for (const WeakDirection& weak : record.weak_directions) {
    Json one = {{"name", weak.name}, {"sigma", weak.sigma}};
    if (!weak.unit.empty()) one["unit"] = weak.unit;
    json["weak_directions"].push_back(one);
  }
  json["residual_unit"] = record.residual_unit;
  json["residual_rms"] = record.residual_rms;
  if (record.held_out_rms) json["held_out_rms"] = *record.held_out_rms;
  json["views"] = Json::array();
  for (const ViewResidual& view : record.views) {
    Json one = {{"name", view.name}, {"points", view.points}, {"rms", view.rms}};
    if (view.outlier) one["outlier"] = true;
    json["views"].push_back(one);
  }
  return json;
}

std::vector<CalibrationRecord> readRecords(const YamlField& calibration) {
  YamlMap map(calibration.path, *calibration.node, calibration.key);
  std::vector<CalibrationRecord> records;
  for (const std::string& kind : kKinds) {
    if (const auto record = map.find(kind)) records.push_back(readRecord(calibration.path, kind, *record->node));
  }
  map.refuseOthers();
  return records;
}

std::vector<CalibrationRecord> readRecords(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".yaml" && extension != ".yml") return {};
  const YamlNode root = readYaml(path);
  const auto calibration = YamlMap(path, root, "file").find("calibration");
  return calibration ? readRecords(*calibration) : std::vector<CalibrationRecord>{};
}

CalibrationInput hashedInput(const std::string& path) {
  const std::string content = readWholeFile(path);
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  if (EVP_Digest(content.data(), content.size(), digest, &size, EVP_sha256(), nullptr) != 1) {
    throw InputError(path, "", "", "cannot be hashed");
  }
  CalibrationInput input{path, ""};
  for (unsigned int i = 0; i < size; ++i) input.sha256 += formatted("%02x", digest[i]);
  return input;
}

std::string dateNow() { return dateOf(Clock::to_time_t(Clock::now())); }

std::vector<std::string> checkRecords(const std::string& path, const std::vector<CalibrationRecord>& records,
                                      const RecordGate& gate, Clock::time_point now) {
  std::vector<std::string> warnings;
  for (const CalibrationRecord& record : records) {
    const std::string field = "calibration." + record.kind;
    if (!gate.machine.empty() && !record.machine.empty() && record.machine != gate.machine) {
      throw InputError(path, field + ".machine", record.machine,
                       "must be of the machine that is used, " + gate.machine);
    }
    if (!gate.machine.empty() && record.machine.empty()) {
      warnings.push_back(path + ": " + field + ": does not say of which machine it is");
    }
    const auto made = timeOf(record.date);
    if (!made) throw InputError(path, field + ".date", record.date, "must be a date as 2026-01-31T12:00:00Z");
    const double age_days = std::chrono::duration<double>(now - *made).count() / 86400;
    if (age_days > gate.max_age_days) {
      warnings.push_back(path + ": " + field + ": " +
                         formatted("is %.0f days old, more than %.0f: calibrate again", age_days, gate.max_age_days));
    }
    // A clock that is a day off is a time zone; more is a wrong clock, here or there.
    if (age_days < -1) warnings.push_back(path + ": " + field + ": is dated " + record.date + ", which is yet to come");
  }
  return warnings;
}

}  // namespace angio::calibration_records

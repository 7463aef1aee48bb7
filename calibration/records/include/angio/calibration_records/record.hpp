// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <chrono>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "angio/calibration_records/namespace.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration_records {

/// A file that a calibration was made from, so that one can tell whether it still is the same.
struct CalibrationInput {
  std::string path;
  std::string sha256;  ///< 64 hexadecimal digits.
};

/// How well one view is explained.
struct ViewResidual {
  std::string name;
  int points = 0;        ///< Measured points (or poses) in it.
  double rms = 0;        ///< In the record's residual_unit.
  bool outlier = false;  ///< Left out of the estimate.
};

/// A combination of parameters that the data hardly determine.
struct WeakDirection {
  std::string name;  ///< In a person's words: "source-detector distance against depth of the phantom".
  double sigma = 0;  ///< Standard deviation along it.
  std::string unit;
};

/// What every calibration carries beside its values, in a file's section `calibration: {<kind>: ...}`.
struct CalibrationRecord {
  std::string kind;     ///< "camera", "geometry", "hand_eye" or "registration".
  std::string machine;  ///< Whose calibration it is; empty when nobody said.
  std::string date;     ///< UTC, "2026-01-31T12:00:00Z".
  std::vector<CalibrationInput> inputs;

  std::vector<std::string> parameters;  ///< Names with units, in the order of values and covariance ("fx_px").
  Eigen::VectorXd values;               ///< As many.
  Eigen::MatrixXd covariance;           ///< As many rows and columns, in the units of the names.
  double condition = 1;                 ///< Of the information matrix, scaled to a unit diagonal.
  std::vector<WeakDirection> weak_directions;

  std::string residual_unit;           ///< "px", or "mm".
  double residual_rms = 0;             ///< Over all points of all views that were used.
  std::optional<double> held_out_rms;  ///< Of views that took no part in the estimate.
  std::vector<ViewResidual> views;

  /// Where a parameter stands in values and covariance; nothing when there is none of that name.
  std::optional<Eigen::Index> placeOf(const std::string& parameter) const;

  /// Standard deviation of a parameter by its name. Throws InputError when there is none of that name.
  double sigma(const std::string& parameter) const;
};

/// The record as it stands in a file.
nlohmann::ordered_json recordAsJson(const CalibrationRecord& record);

/// Reads the section `calibration` of a result file: one record per kind. Throws InputError that names file, line, key
/// and rule: a date that is none, a covariance of another size, not symmetric or not positive semidefinite.
std::vector<CalibrationRecord> readRecords(const YamlField& calibration);

/// The records of a file of YAML; none of one without such a section, nor of another kind of file.
std::vector<CalibrationRecord> readRecords(const std::string& path);

/// The hash of a file's bytes. Throws InputError when it cannot be read.
CalibrationInput hashedInput(const std::string& path);

/// Now, in UTC, as records have it.
std::string dateNow();

/// How a program takes the records of a file that it reads.
struct RecordGate {
  std::string machine;        ///< The machine that is to be moved; empty: not known, and not checked.
  double max_age_days = 180;  ///< Older records are warned of.
};

/// Warnings, a line each: too old, or from the future; nobody said which machine. Throws InputError that names
/// file and field for a record of another machine.
std::vector<std::string> checkRecords(const std::string& path, const std::vector<CalibrationRecord>& records,
                                      const RecordGate& gate,
                                      std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

}  // namespace angio::calibration_records

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "angio/calibration_records/namespace.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/io/yaml.hpp"

namespace angio::calibration_records {

/// Reads {rotation, translation_mm} [m], and covariance where the caller takes one. Throws InputError that names file,
/// line, key in full ("T_dsa_cb.rotation"), value and rule: no rotation, a mirrored one, a translation beyond 100 m, a
/// covariance that is none.
Pose readPoseField(const std::string& path, const YamlField& field, std::optional<Matrix6d>* covariance);

/// Reads primary_deg, secondary_deg and, when it is there, table_mm. Throws InputError that names file, line, key,
/// value and rule.
CArmJoints readJoints(YamlMap& map);

/// A pose as it stands in a file: {rotation, translation_mm}, and covariance where there is one.
nlohmann::ordered_json poseAsJson(const Pose& T, const std::optional<Matrix6d>& covariance = std::nullopt);

/// A matrix as a flat list of numbers, row by row.
nlohmann::ordered_json matrixAsJson(const Eigen::Ref<const Eigen::MatrixXd>& M);

/// Whether a covariance may leave a direction without variance.
enum class Definiteness { kPositive, kSemi };

/// A covariance as it was read from a field, made symmetric. Throws InputError that names the field when it is not
/// symmetric or not as definite as wanted, up to the rounding of files, each number in units of its own deviation.
Eigen::MatrixXd requireCovariance(const YamlField& field, const Eigen::MatrixXd& read, Definiteness wanted);

}  // namespace angio::calibration_records

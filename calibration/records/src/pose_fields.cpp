// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/pose_fields.hpp"

#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/io/pose_files.hpp"

namespace angio::calibration_records {
namespace {

using RowMajor6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

constexpr double kFarthest_mm = 100e3;
constexpr double kRounded = 1e-6;  // What six digits leave.

Matrix6d readCovariance(const YamlField& field) {
  const std::vector<double> entries = field.numbers(36);
  return requireCovariance(field, Eigen::Map<const RowMajor6d>(entries.data()), Definiteness::kPositive);
}

}  // namespace

Pose readPoseField(const std::string& path, const YamlField& field, std::optional<Matrix6d>* covariance) {
  YamlMap map(path, *field.node, field.key);
  Pose T = Pose::Identity();
  const auto need = [&](const std::string& key) {
    const std::string full = field.key + "." + key;
    if (const auto found = map.find(key)) return YamlField{path, full, found->node};
    throw InputError(field.place(), full, "", "is missing");
  };
  T.linear() = readRotation(need("rotation"));
  const std::vector<double> t_mm = need("translation_mm").numbers(3, -kFarthest_mm, kFarthest_mm);
  T.translation() = 1e-3 * Eigen::Map<const Eigen::Vector3d>(t_mm.data());
  if (covariance) {
    if (const auto given = map.find("covariance")) *covariance = readCovariance(*given);
  }
  map.refuseOthers();
  return T;
}

CArmJoints readJoints(YamlMap& map) {
  CArmJoints joints = CArmJoints::Zero();
  const YamlField primary = map.need("primary_deg"), secondary = map.need("secondary_deg");
  joints[0] = degToRad(primary.between(-180, 180));
  joints[1] = degToRad(secondary.between(-90, 90));
  if (const auto table = map.find("table_mm")) {
    joints.tail<3>() = 1e-3 * Eigen::Map<const Eigen::Vector3d>(table->numbers(3, -1e4, 1e4).data());
  }
  return joints;
}

nlohmann::ordered_json matrixAsJson(const Eigen::Ref<const Eigen::MatrixXd>& M) {
  auto list = nlohmann::ordered_json::array();
  for (Eigen::Index r = 0; r < M.rows(); ++r) {
    for (Eigen::Index c = 0; c < M.cols(); ++c) list.push_back(M(r, c));
  }
  return list;
}

nlohmann::ordered_json poseAsJson(const Pose& T, const std::optional<Matrix6d>& covariance) {
  nlohmann::ordered_json json = {{"rotation", matrixAsJson(T.linear())},
                                 {"translation_mm", matrixAsJson(1e3 * T.translation())}};
  if (covariance) json["covariance"] = matrixAsJson(*covariance);
  return json;
}

Eigen::MatrixXd requireCovariance(const YamlField& field, const Eigen::MatrixXd& read, Definiteness wanted) {
  const bool semi = wanted == Definiteness::kSemi;
  const char* const rule = semi ? "must be positive semidefinite" : "must be positive definite";
  if (read.size() == 0) return read;
  if (!read.allFinite()) field.refuse(rule);
  const double least = read.diagonal().minCoeff();
  if (!(semi ? least >= 0 : least > 0)) field.refuse(rule);
  // So that a small number counts as much as a large one.
  const Eigen::VectorXd scale = read.diagonal().cwiseSqrt().unaryExpr([](double s) { return s > 0 ? 1 / s : 1; });
  Eigen::MatrixXd scaled = scale.asDiagonal() * read * scale.asDiagonal();
  if (!((scaled - scaled.transpose()).cwiseAbs().maxCoeff() <= kRounded)) field.refuse("must be symmetric");
  scaled = 0.5 * (scaled + scaled.transpose()).eval();
  if (semi) scaled.diagonal().array() += kRounded;
  if (scaled.llt().info() != Eigen::Success) field.refuse(rule);
  return 0.5 * (read + read.transpose());
}

}  // namespace angio::calibration_records

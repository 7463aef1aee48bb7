// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/pose_files.hpp"

#include <charconv>
#include <nlohmann/json.hpp>

#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/io/case_files.hpp"
#include "angio/io/dicom_registration.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
#include "angio/io/xa_files.hpp"
#include "angio/io/yaml.hpp"

namespace angio::io {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMajor6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

constexpr double kFarthest_mm = 100e3;

Matrix6d readCovariance(const YamlField& field) {
  std::vector<double> values;
  if (field.node->kind == YamlNode::Kind::kSequence && field.node->items.size() == 6) {
    for (std::size_t r = 0; r < 6; ++r) {
      const auto row = field.item(r).numbers(6);
      values.insert(values.end(), row.begin(), row.end());
    }
  } else {
    if (field.node->kind != YamlNode::Kind::kSequence || field.node->items.size() != 36) {
      field.refuse("must be a list of 36 numbers, or of 6 rows of 6");
    }
    values = field.numbers(36);
  }
  const Matrix6d covariance = Eigen::Map<const RowMajor6d>(values.data());
  const double scale = covariance.diagonal().cwiseAbs().maxCoeff();
  // Files are rounded: six digits of the largest variance are what may be asked of them.
  if (!((covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * scale)) field.refuse("must be symmetric");
  const Matrix6d symmetric = 0.5 * (covariance + covariance.transpose());
  if (!(eigenvaluesOfSymmetric(symmetric).minCoeff() >= -1e-6 * scale)) field.refuse("must be positive semidefinite");
  return symmetric;
}

void requireFrame(const std::optional<YamlField>& field, const std::string& frame) {
  if (field && field->text() != frame) field->refuse("must be " + frame);
}

// The rotation and translation of a pose file.
Pose readTransform(YamlMap& map) {
  Pose T = Pose::Identity();
  T.linear() = readRotation(map.need("rotation"));
  const std::vector<double> t_mm = map.need("translation_mm").numbers(3, -kFarthest_mm, kFarthest_mm);
  T.translation() = Eigen::Map<const Eigen::Vector3d>(t_mm.data()) / 1e3;
  return T;
}

template <typename Matrix>
std::vector<double> numbersOf(const Matrix& row_major) {
  return {row_major.data(), row_major.data() + row_major.size()};
}

}  // namespace

Eigen::Matrix3d readRotation(const YamlField& field) {
  const std::vector<double> entries = field.numbers(9);
  const Eigen::Matrix3d R = Eigen::Map<const RowMajor3d>(entries.data());
  if (rotationDefect(-R) < 1e-3) field.refuse("must be a rotation matrix; this one mirrors (its determinant is -1)");
  const double defect = rotationDefect(R);
  if (!(defect < 1e-3)) {
    field.refuse("must be a rotation matrix; R^T R differs from the identity by " + formatValue(defect) +
                 (R.determinant() <= 0 ? ", and the determinant is not positive" : ""));
  }
  return nearestRotation(R);
}

PoseFile readPose(const std::string& path) {
  if (isDicom(path)) {
    const DicomRegistration read = readDicomRegistration(path);
    return {read.T_camera_model, std::nullopt, read.model_id};
  }
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "pose");
  PoseFile result;
  result.T_camera_model = readTransform(map);
  if (const auto covariance = map.find("covariance")) result.covariance = readCovariance(*covariance);
  if (const auto id = map.find("model_id")) result.model_id = readModelId(*id);
  requireFrame(map.find("parent"), "camera");
  requireFrame(map.find("child"), "model");
  map.refuseOthers();
  return result;
}

// Of 64 bits, which a double does not hold.
ModelId readModelId(const YamlField& field) {
  const std::string text = field.text();
  std::int64_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc() || end != text.data() + text.size()) field.refuse("must be a whole number of 64 bits");
  return ModelId{id};
}

void requireTree(const std::string& path, ModelId model_id, const VesselTree& tree, const std::string& remedy) {
  const ModelId own = modelId(tree);
  if (model_id == ModelId::kUnknown || model_id == own) return;
  throw InputError(path, "model_id", std::to_string(static_cast<std::int64_t>(model_id)),
                   "must be that of the vessel tree, " + std::to_string(static_cast<std::int64_t>(own)) + remedy);
}

Pose readViewPose(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "pose");
  const Pose T = readTransform(map);
  for (const char* key : {"covariance", "model_id", "parent", "child"})
    map.find(key);  // As in other poses; here they say nothing.
  map.refuseOthers();
  return T;
}

void writePose(const std::string& path, const PoseFile& pose) {
  const RowMajor3d R = pose.T_camera_model.linear();
  requireFinite(path, "rotation", R.sum());
  requireFinite(path, "translation_mm", pose.T_camera_model.translation().sum());
  if (pose.covariance) requireFinite(path, "covariance", pose.covariance->sum());
  nlohmann::ordered_json json = {{"rotation", numbersOf(R)}};
  for (const double x : pose.T_camera_model.translation()) json["translation_mm"].push_back(millimetres(x));
  if (pose.covariance) json["covariance"] = numbersOf(RowMajor6d(*pose.covariance));
  if (pose.model_id != ModelId::kUnknown) json["model_id"] = static_cast<std::int64_t>(pose.model_id);
  json["parent"] = "camera";
  json["child"] = "model";
  writeWholeFile(path, asYaml(json));
}

}  // namespace angio::io

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/pose_files.hpp"

#include <Eigen/Eigenvalues>

#include "angio/base/errors.hpp"
#include "angio/io/text.hpp"
#include "angio/io/whole_file.hpp"
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
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(symmetric, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues().minCoeff() >= -1e-6 * scale)) field.refuse("must be positive semidefinite");
  return symmetric;
}

void requireFrame(const std::optional<YamlField>& field, const std::string& frame) {
  if (field && field->text() != frame) field->refuse("must be " + frame);
}

template <typename Matrix>
std::string listOf(const Matrix& row_major) {
  std::string list = "[";
  for (Eigen::Index i = 0; i < row_major.size(); ++i) list += (i > 0 ? ", " : "") + exact(row_major.data()[i]);
  return list + "]\n";
}

}  // namespace

PoseFile readPose(const std::string& path) {
  const YamlNode root = readYaml(path);
  YamlMap map(path, root, "pose");
  PoseFile result;

  const YamlField rotation = map.need("rotation");
  const std::vector<double> entries = rotation.numbers(9);
  const Eigen::Matrix3d R = Eigen::Map<const RowMajor3d>(entries.data());
  const double defect = rotationDefect(R);
  if (!(defect < 1e-3)) {
    rotation.refuse("must be a rotation matrix; R^T R differs from the identity by " + formatValue(defect) +
                    (R.determinant() <= 0 ? ", and the determinant is not positive" : ""));
  }
  result.T_camera_model.linear() = nearestRotation(R);

  const YamlField translation = map.need("translation_mm");
  const std::vector<double> t_mm = translation.numbers(3);
  for (std::size_t k = 0; k < 3; ++k) {
    const YamlField item = translation.item(k);
    requireBetween(item.place(), item.key, t_mm[k], -kFarthest_mm, kFarthest_mm);
    result.T_camera_model.translation()[static_cast<Eigen::Index>(k)] = t_mm[k] / 1e3;
  }

  if (const auto covariance = map.find("covariance")) result.covariance = readCovariance(*covariance);
  requireFrame(map.find("parent"), "camera");
  requireFrame(map.find("child"), "model");
  map.refuseOthers();
  return result;
}

void writePose(const std::string& path, const PoseFile& pose) {
  const RowMajor3d R = pose.T_camera_model.linear();
  const Eigen::Vector3d t = pose.T_camera_model.translation();
  requireFinite(path, "rotation", R.sum());
  requireFinite(path, "translation_mm", t.sum());
  if (pose.covariance) requireFinite(path, "covariance", pose.covariance->sum());
  std::string content = "rotation: " + listOf(R);
  content += "translation_mm: [" + exactMillimetres(t.x()) + ", " + exactMillimetres(t.y()) + ", " +
             exactMillimetres(t.z()) + "]\n";
  if (pose.covariance) content += "covariance: " + listOf(RowMajor6d(*pose.covariance));
  writeWholeFile(path, content + "parent: camera\nchild: model\n");
}

}  // namespace angio::io

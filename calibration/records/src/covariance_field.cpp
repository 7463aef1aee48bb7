// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/covariance_field.hpp"

#include <Eigen/Cholesky>

namespace angio {
namespace {

constexpr double kRounded = 1e-6;  // What six digits leave.

}  // namespace

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

}  // namespace angio

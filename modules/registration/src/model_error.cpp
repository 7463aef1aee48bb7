// SPDX-License-Identifier: GPL-2.0-or-later
#include "model_error.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace angio::registration {
namespace {

// With fewer observations beyond the pose's six unknowns nothing can be told of a deformation.
constexpr int kFewestGroups = 12;

// Variances of the linear part of a deformation at the tree's radius of gyration, over that of the rest: a displacement
// whose nine gradients are free, and growth alike on all axes. Measured motions of lungs carried over to brains: with a
// quarter of it the depth of a tree bent by 1 mm is claimed too well in one trial of five.
constexpr double kStrain = 4, kGrowth = 4;

// Over such a length the model's own error goes together: how it was traced, and how vessels are found in an image.
constexpr double kLocal_m = 8e-3;

// Amplitudes that are tried [m]. Of errors that are local no more is believed than a voxel of a CT.
constexpr std::array<double, 8> kDeformation_m = {0, 0.05e-3, 0.1e-3, 0.2e-3, 0.4e-3, 0.8e-3, 1.6e-3, 3.2e-3};
constexpr std::array<double, 4> kLocalError_m = {0.01e-3, 0.06e-3, 0.12e-3, 0.2e-3};
// How many neighbouring points of a centreline err alike: drawn ones singly, extracted ones by the filter's width.
constexpr std::array<double, 2> kTogether = {1, 5};
constexpr double kFloor_px = 0.05;

// Measured deformations differ in their ratio of strain to displacement by more than one amplitude can follow: the
// errors' tails are wider than a normal distribution's.
constexpr double kTails = 1.5;

}  // namespace

// Of the displacements of two places, for an amplitude of 1.
Eigen::Matrix3d ModelError::deformationCovariance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const {
  const double d = (a - b).norm() / length_m_;
  const double alike = (1 + d + d * d / 3) * std::exp(-d) + kStrain * a.dot(b) / radius2_m2_;
  return alike * Eigen::Matrix3d::Identity() + kGrowth / radius2_m2_ * a * b.transpose();
}

ModelError::ModelError(std::vector<ResidualGroup> groups, const Matrix6d& information, double currency, double length_m)
    : groups_(std::move(groups)), length_m_(length_m) {
  const auto n = static_cast<Eigen::Index>(groups_.size());
  if (n < kFewestGroups) {
    groups_.clear();
    return;
  }
  radius2_m2_ = 1e-6;
  for (const ResidualGroup& group : groups_) radius2_m2_ += group.at.squaredNorm() / static_cast<double>(n);
  Eigen::MatrixXd deformed(n, n), local(n, n);  // Of the groups' residuals, for an amplitude of 1 m [px^2].
  for (Eigen::Index i = 0; i < n; ++i) {
    const ResidualGroup& a = groups_[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j <= i; ++j) {
      const ResidualGroup& b = groups_[static_cast<std::size_t>(j)];
      deformed(i, j) = deformed(j, i) = a.gradient.dot(deformationCovariance(a.at, b.at) * b.gradient);
      local(i, j) = local(j, i) = a.gradient.dot(b.gradient) * std::exp(-(a.at - b.at).norm() / kLocal_m);
    }
  }
  Eigen::Matrix<double, 6, Eigen::Dynamic> pull(6, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ResidualGroup& group = groups_[static_cast<std::size_t>(i)];
    pull.col(i) = currency * group.pull * group.jacobian;
  }
  gain_ = information.ldlt().solve(pull);
  if (!gain_.allFinite() || !deformed.allFinite()) {
    groups_.clear();
    return;
  }
  estimate(deformed, local);
  pose_ = amplitude_m_ * amplitude_m_ * gain_ * deformed * gain_.transpose();
}

void ModelError::estimate(const Eigen::MatrixXd& deformed, const Eigen::MatrixXd& local) {
  const Eigen::Index n = deformed.rows();
  Eigen::MatrixXd design(n, 7);  // Jacobians and residuals.
  Eigen::VectorXd noise(n);
  double scatter = 0, weight = 0;
  for (const ResidualGroup& group : groups_) {
    scatter += group.weight * group.scatter_px2;
    weight += group.weight;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const ResidualGroup& group = groups_[static_cast<std::size_t>(i)];
    design.row(i) << group.jacobian.transpose(), group.residual_px;
    noise[i] = kFloor_px * kFloor_px + scatter / weight / std::max(1.0, group.weight);
  }
  // Columns of like size, for the determinant's sake.
  for (int k = 0; k < 6; ++k) design.col(k) /= std::max(1e-12, design.col(k).norm());

  struct Weighed {
    double log_likelihood, deformation2_m2, local2_m2;
  };
  std::vector<Weighed> tried;
  Eigen::MatrixXd base(n, n), C(n, n), whitened(n, 7);
  for (const double together : kTogether) {
    for (const double local_m : kLocalError_m) {
      base = local_m * local_m * local;
      base.diagonal() += together * noise;
      for (const double deformation_m : kDeformation_m) {
        C = base + deformation_m * deformation_m * deformed;
        const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(C);
        if (factor.info() != Eigen::Success) continue;
        whitened = design;
        factor.matrixL().solveInPlace(whitened);
        const Matrix6d normal = whitened.leftCols<6>().transpose() * whitened.leftCols<6>();
        const Vector6d right = whitened.leftCols<6>().transpose() * whitened.col(6);
        const Eigen::LDLT<Matrix6d> of_pose(normal);
        const double left = whitened.col(6).squaredNorm() - right.dot(of_pose.solve(right));
        const double log_determinants =
            2 * factor.matrixLLT().diagonal().array().log().sum() + of_pose.vectorD().array().max(1e-300).log().sum();
        const double log_likelihood = -0.5 * (log_determinants + left);
        if (std::isfinite(log_likelihood)) {
          tried.push_back({log_likelihood, deformation_m * deformation_m, local_m * local_m});
        }
      }
    }
  }
  double best = -1e300, sum = 0, deformation2_m2 = 0, local2_m2 = 0;
  for (const Weighed& w : tried) best = std::max(best, w.log_likelihood);
  for (const Weighed& w : tried) {
    const double probability = std::exp(w.log_likelihood - best);
    sum += probability;
    deformation2_m2 += probability * w.deformation2_m2;
    local2_m2 += probability * w.local2_m2;
  }
  if (tried.empty()) return;
  amplitude_m_ = kTails * std::sqrt(deformation2_m2 / sum);
  local_m_ = std::sqrt(local2_m2 / sum);
}

Eigen::Matrix3d ModelError::pointCovariance(const Eigen::Vector3d& at) const {
  if (groups_.empty()) return Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 6> J;
  J << Eigen::Matrix3d::Identity(), -skew(at);
  Eigen::Matrix<double, 6, 3> follows = Eigen::Matrix<double, 6, 3>::Zero();  // Of the twist with the point itself.
  for (std::size_t i = 0; i < groups_.size(); ++i) {
    const ResidualGroup& group = groups_[i];
    follows +=
        gain_.col(static_cast<Eigen::Index>(i)) * (group.gradient.transpose() * deformationCovariance(group.at, at));
  }
  const Eigen::Matrix3d mixed = J * follows;
  return J * pose_ * J.transpose() +
         amplitude_m_ * amplitude_m_ * (deformationCovariance(at, at) - mixed - mixed.transpose()) +
         local_m_ * local_m_ * Eigen::Matrix3d::Identity();
}

}  // namespace angio::registration

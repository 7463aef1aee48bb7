// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/tree_deformation.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace angio::simulation {
namespace {

// Of the measured points as many decide about a place.
constexpr int kNeighbors = 40;

double extentOf(const Eigen::Matrix3Xd& points) {
  return (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).maxCoeff();
}

// The best small rigid motion [v; w] through the displacements, about the centroid.
Twist rigidPartOf(const Eigen::Matrix3Xd& displacements, const Eigen::Matrix3Xd& centered) {
  Matrix6d normal = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  Eigen::Matrix<double, 3, 6> J;
  J.leftCols<3>().setIdentity();
  for (Eigen::Index i = 0; i < centered.cols(); ++i) {
    J.rightCols<3>() = -skew(centered.col(i));
    normal += J.transpose() * J;
    right += J.transpose() * displacements.col(i);
  }
  return normal.completeOrthogonalDecomposition().solve(right);  // A straight vessel has no roll.
}

}  // namespace

Eigen::Matrix3d uniformRotation(double u, double v, double w) {
  const double a = 2 * kPi * v, b = 2 * kPi * w, r = std::sqrt(1 - u), q = std::sqrt(u);
  return Eigen::Quaterniond(q * std::cos(b), r * std::sin(a), r * std::cos(a), q * std::sin(b)).toRotationMatrix();
}

DisplacementField carriedOver(const MeasuredMotion& motion, const VesselTree& tree, const Eigen::Matrix3d& R) {
  const double scale = extentOf(tree.points()) / std::max(1e-6, extentOf(motion.points));
  const Eigen::Vector3d middle = motion.points.rowwise().mean();
  const Eigen::Matrix3Xd points = scale * R * (motion.points.colwise() - middle), moved = R * motion.displacements_m;
  return [points, moved](const Eigen::Vector3d& p) -> Eigen::Vector3d {
    std::vector<std::pair<double, Eigen::Index>> near;
    for (Eigen::Index i = 0; i < points.cols(); ++i) near.emplace_back((points.col(i) - p).squaredNorm(), i);
    const auto count = std::min<std::ptrdiff_t>(kNeighbors, static_cast<std::ptrdiff_t>(near.size()));
    std::nth_element(near.begin(), near.begin() + (count - 1), near.end());
    const double reach2 = near[count - 1].first;
    Eigen::Matrix4d normal = 1e-6 * Eigen::Matrix4d::Identity();
    Eigen::Matrix<double, 4, 3> right = Eigen::Matrix<double, 4, 3>::Zero();
    const double unit_m = std::sqrt(std::max(reach2, 1e-12));
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const auto [squared, i] = near[k];
      const double weight = std::exp(-2 * squared / std::max(reach2, 1e-12));
      Eigen::Vector4d basis;
      basis << 1, (points.col(i) - p) / unit_m;
      normal += weight * basis * basis.transpose();
      right += weight * basis * moved.col(i).transpose();
    }
    return normal.ldlt().solve(right).row(0).transpose();
  };
}

TreeDeformation::TreeDeformation(const VesselTree& tree, DisplacementField field, double rms_m)
    : field_(std::move(field)), centroid_(tree.centroid()) {
  const Eigen::Matrix3Xd& p = tree.points();
  rigid_ = rigidPartOf(at(p), p.colwise() - centroid_);
  const double rms = std::sqrt(at(p).squaredNorm() / static_cast<double>(p.cols()));
  scale_ = rms_m / std::max(rms, 1e-12);
}

Eigen::Matrix3Xd TreeDeformation::at(const Eigen::Matrix3Xd& points) const {
  Eigen::Matrix3Xd d(3, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d centered = points.col(i) - centroid_;
    d.col(i) = scale_ * (field_(centered) - rigid_.head<3>() - rigid_.tail<3>().cross(centered));
  }
  return d;
}

}  // namespace angio::simulation

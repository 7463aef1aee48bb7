// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_solvers.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>

namespace angio::calibration {
namespace {

// Nearer to half a turn, noise decides on which side of it a motion is: its axis has no sign.
const double kMaxTurn_rad = degToRad(170);

using Matrix9d = Eigen::Matrix<double, 9, 9>;

Eigen::Matrix3d unstacked(const Eigen::Matrix<double, 9, 1>& columns) {
  return Eigen::Map<const Eigen::Matrix3d>(columns.data());
}

// Both translations, the rotations being known: R_h t_X - t_Z = -R_h R_X t_c - t_h for all poses.
HandEyeTransforms withTranslations(const HandEyeEquations& e, const Eigen::Matrix3d& R_X, const Eigen::Matrix3d& R_Z) {
  Matrix6d A = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    Eigen::Matrix<double, 3, 6> J;
    J << e.hands[i].linear(), -Eigen::Matrix3d::Identity();
    A += J.transpose() * J;
    b -= J.transpose() * (e.hands[i] * (R_X * e.cameras[i].translation()));
  }
  const Vector6d t = A.fullPivHouseholderQr().solve(b);
  HandEyeTransforms found;
  found.X.linear() = R_X;
  found.X.translation() = t.head<3>();
  found.Z.linear() = R_Z;
  found.Z.translation() = t.tail<3>();
  return found;
}

}  // namespace

void HandEyeEquations::add(const Pose& hand, const Pose& camera) {
  hands.push_back(hand);
  cameras.push_back(camera);
}

HandEyeEquations handEyeEquations(const PoseSet& set) {
  HandEyeEquations equations;
  for (const HandEyePose& pose : set.poses) {
    equations.add(set.setup == HandEyeSetup::kEyeInHand ? pose.T_base_hand : Pose(pose.T_base_hand.inverse()),
                  pose.T_camera_object);
  }
  return equations;
}

HandEyeTransforms solveParkMartin(const HandEyeEquations& e) {
  // log A = R_X log B for every motion A = H_j^-1 H_i, B = C_j C_i^-1; the R_X that aligns both sets of vectors.
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Vector3d alpha = logSO3(e.hands[j].linear().transpose() * e.hands[i].linear());
      const Eigen::Vector3d beta = logSO3(e.cameras[j].linear() * e.cameras[i].linear().transpose());
      if (alpha.norm() < kMaxTurn_rad) M += alpha * beta.transpose();
    }
  }
  const Eigen::Matrix3d R_X = nearestRotation(M);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) sum += e.hands[i].linear() * R_X * e.cameras[i].linear();
  return withTranslations(e, R_X, nearestRotation(sum));
}

HandEyeTransforms solveShah(const HandEyeEquations& e) {
  // vec R_X = (R_c kron R_h^T) vec R_Z for every pose (vec stacks columns).
  Matrix9d K = Matrix9d::Zero();
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Eigen::Matrix3d R_h = e.hands[i].linear().transpose();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) K.block<3, 3>(3 * r, 3 * c) += e.cameras[i].linear()(r, c) * R_h;
    }
  }
  const Eigen::JacobiSVD<Matrix9d> svd(K, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d X = unstacked(svd.matrixU().col(0)), Z = unstacked(svd.matrixV().col(0));
  if (X.determinant() < 0) {
    X = -X;
    Z = -Z;
  }
  return withTranslations(e, nearestRotation(X), nearestRotation(Z));
}

HandEyeResiduals handEyeResiduals(const HandEyeEquations& e, const HandEyeTransforms& t) {
  HandEyeResiduals squares;
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Pose Z = e.hands[i] * t.X * e.cameras[i];
    squares.rotation_rad += std::pow(rotationAngle(t.Z.linear().transpose() * Z.linear()), 2);
    squares.translation_m += (Z.translation() - t.Z.translation()).squaredNorm();
  }
  const double count = std::max<double>(1, static_cast<double>(e.size()));
  return {std::sqrt(squares.rotation_rad / count), std::sqrt(squares.translation_m / count)};
}

}  // namespace angio::calibration

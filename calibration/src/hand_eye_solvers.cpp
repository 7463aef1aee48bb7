// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye_solvers.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "hand_eye_problem.hpp"

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

double leverOf(const HandEyeEquations& e) {
  double squares = 0;
  for (const Pose& camera : e.cameras) squares += camera.translation().squaredNorm();
  return std::sqrt(squares / static_cast<double>(e.size()));
}

double bestSquares(const HandEyeEquations& e, const HandEyeTransforms& t, std::size_t kept, double lever_m) {
  std::vector<double> squares;
  for (std::size_t i = 0; i < e.size(); ++i) {
    const Pose Z = e.hands[i] * t.X * e.cameras[i];
    squares.push_back(std::pow(rotationAngle(t.Z.linear().transpose() * Z.linear()), 2) +
                      (Z.translation() - t.Z.translation()).squaredNorm() / (lever_m * lever_m));
  }
  const auto end = squares.begin() + static_cast<std::ptrdiff_t>(std::min(kept, squares.size()));
  std::partial_sort(squares.begin(), end, squares.end());
  return std::accumulate(squares.begin(), end, 0.0);
}

HandEyeTransforms robustStart(const HandEyeEquations& e, HandEyeMount mount, const HandEyeSettings& settings) {
  constexpr std::size_t kDrawn = 4;  // One more than is needed: three poses make poor starts.
  constexpr double kTrimmed = 0.45;  // Of two machines' poses in one file, half are one's.
  const auto kept =
      std::max<std::size_t>(3, static_cast<std::size_t>(std::ceil(kTrimmed * static_cast<double>(e.size()))));
  const double lever_m = leverOf(e);
  HandEyeTransforms best;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const HandEyeTransforms& t) {
    const double here = bestSquares(e, t, kept, lever_m);
    if (!(here < least)) return;
    least = here;
    best = t;
  };
  if (mount == HandEyeMount::kIdentity) {
    for (std::size_t i = 0; i < e.size(); ++i) consider({Pose::Identity(), e.hands[i] * e.cameras[i]});
    return best;
  }
  const auto solveOver = [&](const HandEyeEquations& some) {
    consider(solveParkMartin(some));
    consider(solveShah(some));
  };
  solveOver(e);
  if (e.size() <= kDrawn) return best;
  std::mt19937 engine(static_cast<unsigned>(settings.seed));
  std::vector<std::size_t> shuffled(e.size());
  std::iota(shuffled.begin(), shuffled.end(), std::size_t{0});
  for (int draw = 0; draw < settings.starts; ++draw) {
    HandEyeEquations few;
    for (std::size_t k = 0; k < kDrawn; ++k) {
      // std::uniform_int_distribution is not the same on every machine; the bias of a remainder is of no account here.
      std::swap(shuffled[k], shuffled[k + engine() % (shuffled.size() - k)]);
      few.add(e.hands[shuffled[k]], e.cameras[shuffled[k]]);
    }
    solveOver(few);
  }
  return best;
}

}  // namespace angio::calibration

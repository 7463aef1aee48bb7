// SPDX-License-Identifier: GPL-2.0-or-later
#include "nonrigid_step.hpp"

#include <algorithm>
#include <limits>

namespace angio::registration {
namespace {

constexpr double kMillimetre = 1e-3;

// Lower half of a 3 x 3 block, in the order of diagonal_block_.
constexpr int kBlockRow[6] = {0, 1, 2, 1, 2, 2};
constexpr int kBlockColumn[6] = {0, 0, 0, 1, 1, 2};
constexpr int kDiagonal[3] = {0, 3, 5};

}  // namespace

NonrigidStep::NonrigidStep(const VesselTree& tree, const IterativePnpSettings& settings)
    : points_m_(tree.points()), own_weight_(settings.lambda2 * settings.w1), diagonal_block_(tree.size()) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < tree.size(); ++i) {
    for (int e = 0; e < 6; ++e) {
      entries.emplace_back(3 * i + kBlockRow[e], 3 * i + kBlockColumn[e],
                           kBlockRow[e] == kBlockColumn[e] ? own_weight_ : 0);
    }
  }
  for (const auto& [i, j, weight] : displacementPairs(tree, settings)) {
    couplings_.push_back({i, j, settings.lambda2 * weight});
    for (int k = 0; k < 3; ++k) {
      entries.emplace_back(3 * i + k, 3 * j + k, -couplings_.back().weight);
      entries.emplace_back(3 * i + k, 3 * i + k, couplings_.back().weight);
      entries.emplace_back(3 * j + k, 3 * j + k, couplings_.back().weight);
    }
  }
  system_.resize(3 * tree.size(), 3 * tree.size());
  system_.setFromTriplets(entries.begin(), entries.end());
  system_.makeCompressed();
  cholesky_.analyzePattern(system_);
  regulariser_values_.assign(system_.valuePtr(), system_.valuePtr() + system_.nonZeros());
  for (int i = 0; i < tree.size(); ++i) {
    for (int e = 0; e < 6; ++e) {
      const double* value = &system_.coeffRef(3 * i + kBlockRow[e], 3 * i + kBlockColumn[e]);
      diagonal_block_[i][e] = static_cast<int>(value - system_.valuePtr());
    }
  }
}

// One view's share of the data term.
void NonrigidStep::addView(const XrayView& view, const Pose& T_camera_model, const Pull& pull,
                           const Eigen::Matrix3Xd& displacements_m, Eigen::VectorXd& rhs) {
  const Pose T_view_model = view.T_view_first * T_camera_model;
  for (Eigen::Index i = 0; i < points_m_.cols(); ++i) {
    if (pull.weight[i] == 0) continue;
    Eigen::Matrix<double, 2, 3> J_projection;
    const auto pixel = view.camera.project(T_view_model * (points_m_.col(i) + displacements_m.col(i)), &J_projection);
    if (!pixel) continue;
    const Eigen::Matrix<double, 2, 3> J = J_projection * T_view_model.linear() * kMillimetre;  // [px/mm]
    const Eigen::Matrix3d block = pull.weight[i] * J.transpose() * J;
    for (int e = 0; e < 6; ++e) {
      system_.valuePtr()[diagonal_block_[i][e]] += block(kBlockRow[e], kBlockColumn[e]);
    }
    const Eigen::Vector2d wanted = pull.target_px.col(i) - *pixel + J * displacements_m.col(i) / kMillimetre;
    rhs.segment<3>(3 * i) += pull.weight[i] * J.transpose() * wanted;
  }
}

std::optional<Eigen::Matrix3Xd> NonrigidStep::solve(const XrayViews& views, const Pose& T_camera_model,
                                                    const std::vector<Pull>& pulls,
                                                    const Eigen::Matrix3Xd& displacements_m, double damping) {
  const auto n = points_m_.cols();
  std::copy(regulariser_values_.begin(), regulariser_values_.end(), system_.valuePtr());
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(3 * n);
  for (std::size_t v = 0; v < views.size(); ++v) addView(views[v], T_camera_model, pulls[v], displacements_m, rhs);
  if (damping > 0) {
    for (Eigen::Index i = 0; i < n; ++i) {
      for (int k = 0; k < 3; ++k) {
        double& diagonal = system_.valuePtr()[diagonal_block_[static_cast<std::size_t>(i)][kDiagonal[k]]];
        rhs[3 * i + k] += damping * diagonal * displacements_m(k, i) / kMillimetre;
        diagonal += damping * diagonal;
      }
    }
  }
  cholesky_.factorize(system_);
  if (cholesky_.info() != Eigen::Success) return std::nullopt;
  const Eigen::VectorXd solution = cholesky_.solve(rhs);
  if (!solution.allFinite()) return std::nullopt;
  return Eigen::Map<const Eigen::Matrix3Xd>(solution.data(), 3, n) * kMillimetre;
}

double NonrigidStep::cost(const XrayViews& views, const Pose& T_camera_model, const std::vector<Pull>& pulls,
                          const Eigen::Matrix3Xd& displacements_m) const {
  double sum = regulariser(displacements_m);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Pose T_view_model = views[v].T_view_first * T_camera_model;
    for (Eigen::Index i = 0; i < points_m_.cols(); ++i) {
      if (pulls[v].weight[i] == 0) continue;
      const auto pixel = views[v].camera.project(T_view_model * (points_m_.col(i) + displacements_m.col(i)));
      if (!pixel) return std::numeric_limits<double>::infinity();
      sum += pulls[v].weight[i] * (*pixel - pulls[v].target_px.col(i)).squaredNorm();
    }
  }
  return sum;
}

std::optional<Eigen::Matrix3Xd> DampedNonrigid::step(const XrayViews& views, const Pose& T_camera_model,
                                                     const std::vector<Pull>& pulls,
                                                     const Eigen::Matrix3Xd& displacements_m) {
  const double cost_px2 = system_.cost(views, T_camera_model, pulls, displacements_m);
  std::optional<Eigen::Matrix3Xd> solved;
  const bool lowered = damping_.step([&](double damping) {
    solved = system_.solve(views, T_camera_model, pulls, displacements_m, damping);
    return solved && system_.cost(views, T_camera_model, pulls, *solved) <= cost_px2;
  });
  return lowered ? solved : std::nullopt;
}

double NonrigidStep::regulariser(const Eigen::Matrix3Xd& displacements_m) const {
  double sum = own_weight_ * displacements_m.squaredNorm();
  for (const auto& c : couplings_) {
    sum += c.weight * (displacements_m.col(c.i) - displacements_m.col(c.j)).squaredNorm();
  }
  return sum / (kMillimetre * kMillimetre);
}

}  // namespace angio::registration

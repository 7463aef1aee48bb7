// SPDX-License-Identifier: GPL-2.0-or-later
#include "prediction_record.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace angio::motion {
namespace {

// Squared Mahalanobis distance beyond which a single error counts no more.
constexpr double kMaxSurprise = 50;
constexpr double kCovarianceMemory = 3;  // Of judged_over_s: six numbers need more than one.

constexpr double kMinShare = 0.22;  // Of a covariance that is left when predictions come true far too well.

// P + E, in no direction less than kMinShare of P.
Eigen::Matrix3d sum(const Eigen::Matrix3d& P, const Eigen::Matrix3d& E) {
  // Mostly there is nothing to keep it from.
  const Eigen::Matrix3d above = (1 - kMinShare) * P + E;
  if (above.llt().info() == Eigen::Success) return P + E;
  const Eigen::LLT<Eigen::Matrix3d> root(P);
  if (root.info() != Eigen::Success) return P;
  const Eigen::Matrix3d L = root.matrixL();
  const Eigen::Matrix3d L_inverse = L.triangularView<Eigen::Lower>().solve(Eigen::Matrix3d::Identity());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> relative(L_inverse * E * L_inverse.transpose());
  const Eigen::Matrix3d A = L * relative.eigenvectors();
  return A * (relative.eigenvalues().array() + 1).max(kMinShare).matrix().asDiagonal() * A.transpose();
}

}  // namespace

double PredictionRecord::error() const {
  return weight_ > 0 ? error_sum_ / weight_ : std::numeric_limits<double>::infinity();
}

Eigen::Matrix3d PredictionRecord::honest(const Eigen::Matrix3d& covariance, double horizon_s) const {
  return sum(covariance, std::max(1.0, horizon_s / horizon_s_) * lacking_);
}

void PredictionRecord::judge(double last_time_s, const Eigen::Vector3d& last_position, double time_s,
                             const Eigen::Vector3d& position, const Eigen::Matrix3d& R) {
  while (!open_.empty() && open_.front().time_s <= time_s) {
    const Promise promise = open_.front();
    open_.pop_front();
    if (promise.time_s < last_time_s) continue;
    const double part = (promise.time_s - last_time_s) / std::max(time_s - last_time_s, 1e-9);
    const Eigen::Vector3d error = last_position + part * (position - last_position) - promise.estimate.position;
    // Every promise is judged for its own share of time, whatever the frame rate.
    const double kept = std::exp(-(time_s - last_time_s) / judged_over_s_);
    error_sum_ = kept * error_sum_ + (1 - kept) * squaredMahalanobis(error, R);
    weight_ = kept * weight_ + (1 - kept);
    const Eigen::Matrix3d claimed = promise.estimate.covariance + R;
    const double surprise = squaredMahalanobis(error, sum(promise.estimate.covariance, lacking_) + R);
    const double learnt = 1 - std::exp(-(time_s - last_time_s) / (kCovarianceMemory * judged_over_s_));
    lacking_ += learnt * (std::min(1.0, kMaxSurprise / surprise) * error * error.transpose() - claimed - lacking_);
  }
}

}  // namespace angio::motion

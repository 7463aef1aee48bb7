// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/tip_roll.hpp"

#include <algorithm>
#include <cmath>

namespace angio::navigation {
namespace {

constexpr double kBias = 0.2;            // Usual size of the bias, as a slope.
constexpr double kBiasLength_m = 10e-3;  // On this way it becomes another.
constexpr double kTurnLength_m = 0.1;    // On this way the tip turns by about a radian that nobody wanted.
constexpr double kTurnByRoll = 0.15;     // Share of a roll that does not come through, or comes through later.
constexpr double kEnteredSigma = 0.7;    // In parts of the usual deflection: a fork takes tips from a wide cone.

}  // namespace

TipRoll::TipRoll(double deflection, double dead_band_rad)
    : deflection_(deflection), half_band_rad_(0.5 * dead_band_rad) {
  P_ = Eigen::Vector3d(deflection * deflection, deflection * deflection, kBias * kBias).asDiagonal();
}

Eigen::Matrix2d TipRoll::turn() const {
  const double c = std::cos(roll_rad_), s = std::sin(roll_rad_);
  return (Eigen::Matrix2d() << c, -s, s, c).finished();
}

void TipRoll::move(double roll_rad, double slid_m) {
  const double before = roll_rad_;
  roll_rad_ = moved_ ? std::clamp(roll_rad_, roll_rad - half_band_rad_, roll_rad + half_band_rad_) : roll_rad;
  const double rolled = moved_ ? std::abs(roll_rad_ - before) : 0.0;
  moved_ = true;
  const double slid = std::abs(slid_m);
  // Turning is noise across x, in proportion to its length; how far the tip is deflected changes with the lumen.
  const double turned_variance = slid / kTurnLength_m + kTurnByRoll * kTurnByRoll * std::min(rolled, 1.0);
  const double variance =
      std::min(turned_variance, 1.0) * std::max(state_.head<2>().squaredNorm(), 0.01 * deflection_ * deflection_);
  P_(0, 0) += variance;
  P_(1, 1) += variance;
  const double keep = std::exp(-slid / kBiasLength_m);
  state_[2] *= keep;
  P_.row(2) *= keep;
  P_.col(2) *= keep;
  P_(2, 2) += (1 - keep * keep) * kBias * kBias;
  // Nothing is less known than what is not known at all.
  for (int i = 0; i < 2; ++i) {
    const double shrink = std::sqrt(std::min(1.0, deflection_ * deflection_ / P_(i, i)));
    P_.row(i) *= shrink;
    P_.col(i) *= shrink;
  }
}

void TipRoll::bend(double deflection) {
  const double ratio = deflection / deflection_;
  if (ratio < 1) {
    state_.head<2>() *= ratio;
    P_.topRows<2>() *= ratio;
    P_.leftCols<2>() *= ratio;
  } else {
    const double gained = deflection * deflection - deflection_ * deflection_;
    P_(0, 0) += gained;
    P_(1, 1) += gained;
  }
  deflection_ = deflection;
}

void TipRoll::see(const TipDeflection& deflection) {
  Eigen::Vector3d h;
  h << turn().transpose() * deflection.observable_axis, 1.0;
  const double innovation = deflection.slope - h.dot(state_);
  double variance = h.dot(P_ * h) + deflection.sigma * deflection.sigma;
  // A far value is worth less: as if its own variance were what brings it to three standard deviations.
  variance = std::max(variance, innovation * innovation / 9);
  const Eigen::Vector3d gain = P_ * h / variance;
  state_ += gain * innovation;
  P_ -= gain * (P_ * h).transpose();
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

void TipRoll::entered(const Eigen::Vector2d& direction) {
  if (!(direction.norm() > 0)) return;
  const Eigen::Vector2d seen = deflection_ * direction.normalized();
  Eigen::Matrix<double, 2, 3> H = Eigen::Matrix<double, 2, 3>::Zero();
  H.leftCols<2>() = turn();
  const double sigma = kEnteredSigma * deflection_;
  const Eigen::Matrix2d S = H * P_ * H.transpose() + sigma * sigma * Eigen::Matrix2d::Identity();
  const Eigen::Matrix<double, 3, 2> gain = P_ * H.transpose() * S.inverse();
  state_ += gain * (seen - H * state_);
  P_ -= gain * H * P_;
  P_ = (0.5 * (P_ + P_.transpose())).eval();
}

double TipRoll::angle_rad() const {
  const Eigen::Vector2d x = turn() * state_.head<2>();
  return std::atan2(x.y(), x.x());
}

double TipRoll::std_rad() const {
  const double length = state_.head<2>().norm(), unknown = 3.14159265358979 / std::sqrt(3.0);
  if (!(length > 0)) return unknown;
  const Eigen::Vector2d sideways(-state_[1] / length, state_[0] / length);
  const double across = std::sqrt(std::max(sideways.dot(P_.topLeftCorner<2, 2>() * sideways), 0.0));
  return std::min(std::atan2(across, length) * 2 / std::sqrt(3.0), unknown);
}

double TipRoll::imageJacobian(const Eigen::Vector2d& observable_axis) const {
  const Eigen::Vector2d x = turn() * state_.head<2>();
  return observable_axis.dot(Eigen::Vector2d(-x.y(), x.x()));
}

}  // namespace angio::navigation

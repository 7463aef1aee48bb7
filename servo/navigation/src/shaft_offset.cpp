// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/shaft_offset.hpp"

#include <algorithm>
#include <cmath>

namespace angio::navigation {
namespace {

constexpr double kLength_m = 10e-3;  // Over this way the offset becomes another ...
constexpr double kRoll_rad = 1.5;    // ... and over this roll: a tip that turns pushes its shaft aside.
constexpr double kWays = 6;          // Of these the usual size is learnt from, and of more what kind of catheter it is:
constexpr double kWaysOfNature = 20;  // narrow vessels and wrong ideas of the tip come and go.
constexpr double kMinAxis = 0.3;      // A direction that is seen less well tells nothing of the size.
constexpr double kOfFree = 0.25;      // Of a bend's deflection: a shaft further beside the axis hides its length.
constexpr double kFirm_m = 0.3e-3, kLoose_m = 1e-3;  // Usual offsets of catheters of either kind.
constexpr double kLeast_m = 0.2e-3;                  // The usual size is never taken to be less.

}  // namespace

void ShaftOffset::move(double slid_m, double rolled_rad) {
  const double way = std::abs(slid_m) / kLength_m + std::abs(rolled_rad) / kRoll_rad, keep = std::exp(-way);
  mean_m_ *= keep;
  covariance_ = keep * keep * covariance_ + (1 - keep * keep) * usual_variance_ * Eigen::Matrix2d::Identity();
  learnt_ = std::min(learnt_ + way, 1.0);
}

void ShaftOffset::see(const TipOffset& bent, const Eigen::Vector2d& observable_axis, double offset_m, double std_m) {
  const double expected_m = observable_axis.dot(bent.mean_m), axis = observable_axis.norm();
  const double bent_variance = observable_axis.dot(bent.covariance * observable_axis) + std_m * std_m;
  if (axis > kMinAxis) {
    const double left_m = offset_m - expected_m;
    const double seen = std::max((left_m * left_m - bent_variance) / (axis * axis), kLeast_m * kLeast_m);
    const double gain = 1 - std::exp(-learnt_ / kWays);
    usual_variance_ += gain * (seen - usual_variance_);
    nature_variance_ += (1 - std::exp(-learnt_ / kWaysOfNature)) * (seen - nature_variance_);
    learnt_ = 0;
  }
  const Eigen::Vector2d gain =
      covariance_ * observable_axis / (observable_axis.dot(covariance_ * observable_axis) + bent_variance);
  mean_m_ += gain * (offset_m - expected_m - observable_axis.dot(mean_m_));
  covariance_ -= gain * (covariance_ * observable_axis).transpose();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
}

TipOffset ShaftOffset::with(const TipOffset& bent) const {
  const bool known_length = usual_m() < kOfFree * bent.free_m;
  return {bent.mean_m + mean_m_, bent.covariance + covariance_, known_length ? bent.free_m : 0.0};
}

double ShaftOffset::usual_m() const { return std::sqrt(usual_variance_); }

double ShaftOffset::looseness() const {
  return std::clamp((std::sqrt(nature_variance_) - kFirm_m) / (kLoose_m - kFirm_m), 0.0, 1.0);
}

}  // namespace angio::navigation

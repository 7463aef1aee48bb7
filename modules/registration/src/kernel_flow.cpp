// SPDX-License-Identifier: GPL-2.0-or-later
#include "kernel_flow.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/geometry/decompositions.hpp"
#include "fit_classification.hpp"

namespace angio::registration {
namespace {

// A series of the kernel holds within about its scale: points move by no more than this share of it, rms.
constexpr double kMaxMoveShare = 1;
// Times that a step which lowers the objective is shortened, and by what.
constexpr int kMaxShortenings = 8;
constexpr double kShortening = 0.25;

}  // namespace

double firstPeak(const std::array<double, 4>& c, double max) {
  const auto slope = [&](double t) { return c[0] + t * (2 * c[1] + t * (3 * c[2] + t * 4 * c[3])); };
  // Between the extrema of the slope it rises or falls only, so that each stretch has one root at most.
  double stretches[3] = {max, max, max};
  const double a = 12 * c[3], b = 6 * c[2], d = 2 * c[1];
  const double discriminant = b * b - 4 * a * d;
  if (discriminant > 0) {
    const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    const double roots[2] = {q / a, d / q};
    for (int k = 0; k < 2; ++k) {
      if (roots[k] > 0 && roots[k] < max) stretches[k] = roots[k];
    }
    if (stretches[0] > stretches[1]) std::swap(stretches[0], stretches[1]);
  }
  double low = 0;
  for (const double end : stretches) {
    if (!(slope(end) < 0)) {
      low = end;
      continue;
    }
    double high = end;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (slope(middle) < 0 ? high : low) = middle;
    }
    return high;
  }
  return max;
}

KernelFlow::KernelFlow(const XrayViews& views, const PosePriorTerm& prior, const Pose& T_camera_centered,
                       double match_m)
    : views_(views), prior_(prior), match_m_(match_m), T_camera_centered_(T_camera_centered) {
  now_.views.resize(views.size());
  trial_.views.resize(views.size());
}

bool KernelFlow::begin(const ModelSamples& model, const PairKernel& kernel) {
  kernel_ = kernel;
  seen_.clear();
  picture_metric_.setZero();
  matches_ = 0;
  for (const XrayView& view : views_) {
    seen_.emplace_back(model, view, T_camera_centered_, kernel, match_m_);
    addPictureMetric(seen_.back(), T_camera_centered_, picture_metric_);
    matches_ += seen_.back().matches.sum();
  }
  return alignAt(T_camera_centered_, now_) && matches_ > 0;
}

bool KernelFlow::alignAt(const Pose& T_camera_centered, Alignment& to) const {
  to.total_px2 = -prior_.cost(T_camera_centered);
  for (std::size_t v = 0; v < seen_.size(); ++v) {
    if (!alignView(seen_[v], T_camera_centered, *kernel_, to.views[v])) return false;
    to.total_px2 += to.views[v].value_px2;
  }
  return std::isfinite(to.total_px2);
}

double KernelFlow::step() {
  // Of the prior: half the Hessian and half the gradient of its cost.
  Matrix6d prior_H = Matrix6d::Zero();
  Vector6d half_gradient = Vector6d::Zero();
  prior_.add(T_camera_centered_, prior_H, half_gradient);
  half_gradient = -half_gradient;
  for (std::size_t v = 0; v < seen_.size(); ++v) {
    half_gradient += 0.5 * twistGradient(seen_[v], T_camera_centered_, now_.views[v]);
  }
  const Twist xi = solveSymmetric(picture_metric_ + prior_H, half_gradient);
  const double speed_px = std::sqrt(xi.dot(picture_metric_ * xi) / matches_);
  if (!xi.allFinite() || !(speed_px > 0) || !(half_gradient.dot(xi) > 0)) return 0;

  std::array<double, 4> series{};
  for (std::size_t v = 0; v < seen_.size(); ++v) {
    const auto of_view = taylorAlong(seen_[v], T_camera_centered_, xi, *kernel_, now_.views[v]);
    for (std::size_t k = 0; k < series.size(); ++k) series[k] += of_view[k];
  }
  // The prior's cost along the flow, to second order. The gradient of both is known.
  series[0] = 2 * half_gradient.dot(xi);
  series[1] -= xi.dot(prior_H * xi);
  double t = firstPeak(series, kMaxMoveShare * kernel_->scale_px / speed_px);
  for (int shortened = 0; shortened <= kMaxShortenings; ++shortened, t *= kShortening) {
    Pose T = T_camera_centered_ * expSE3(t * xi);
    T.linear() = nearestRotation(T.linear());
    if (!alignAt(T, trial_) || !(trial_.total_px2 >= now_.total_px2)) continue;
    T_camera_centered_ = T;
    std::swap(now_, trial_);
    return t * speed_px;
  }
  return 0;
}

std::optional<Matrix6d> KernelFlow::covariance(const ModelSamples& model, const Eigen::Vector3d& centroid) const {
  std::vector<Pull> pulls;
  for (std::size_t v = 0; v < seen_.size(); ++v) pulls.push_back(pullOf(seen_[v], model.size(), now_.views[v]));
  const auto system = normalEquations(model.points, views_, T_camera_centered_, pulls, prior_);
  return covarianceOf(system, pulls, T_camera_centered_, centroid);
}

}  // namespace angio::registration

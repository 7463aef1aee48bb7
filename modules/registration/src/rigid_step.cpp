// SPDX-License-Identifier: GPL-2.0-or-later
#include "rigid_step.hpp"
#include "angio/geometry/decompositions.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {
namespace {

// One view's share of the data term.
void addView(const Eigen::Matrix3Xd& points_centered, const XrayCamera& camera, const Pose& T_view_centered,
             const Pull& pull, NormalEquations& sum) {
  // The hottest arithmetic of a registration: eight points at a time, one array a quantity, so that it vectorises.
  constexpr int kLanes = 8;
  using Lanes = Eigen::Array<double, kLanes, 1>;
  const Eigen::Matrix3d R = T_view_centered.linear();
  const Eigen::Vector3d t = T_view_centered.translation();
  const auto& c = camera.parameters();
  Lanes H[6][6], g[6], cost = Lanes::Zero();
  for (int i = 0; i < 6; ++i) {
    g[i].setZero();
    for (int k = 0; k < 6; ++k) H[i][k].setZero();
  }
  for (Eigen::Index first = 0; first < points_centered.cols(); first += kLanes) {
    const Eigen::Index count = std::min<Eigen::Index>(kLanes, points_centered.cols() - first);
    Lanes p[3], weight = Lanes::Zero(), target_u = Lanes::Zero(), target_v = Lanes::Zero();
    for (auto& axis : p) axis.setZero();
    for (Eigen::Index i = 0; i < count; ++i) {
      for (int k = 0; k < 3; ++k) p[k][i] = points_centered(k, first + i);
      weight[i] = pull.weight[first + i];
      target_u[i] = pull.target_px(0, first + i);
      target_v[i] = pull.target_px(1, first + i);
    }
    const auto row = [&](int r) -> Lanes { return R(r, 0) * p[0] + R(r, 1) * p[1] + R(r, 2) * p[2] + t[r]; };
    const Lanes depth = row(2);
    // A point behind the source has no image and no say.
    weight = (depth > 0).select(weight, 0.0);
    const Lanes inverse_depth = 1 / (depth > 0).select(depth, 1.0);
    const Lanes x = row(0) * inverse_depth, y = row(1) * inverse_depth;
    const Lanes residual_u = c.fx_px * x + c.cx_px - target_u, residual_v = c.fy_px * y + c.cy_px - target_v;
    // d(T exp(dx) p) = R (v + w x p): a row a of (projection's Jacobian * R) gives [a, p x a].
    Lanes ju[6], jv[6];
    const Lanes scale_u = c.fx_px * inverse_depth, scale_v = c.fy_px * inverse_depth;
    for (int k = 0; k < 3; ++k) {
      ju[k] = scale_u * (R(0, k) - x * R(2, k));
      jv[k] = scale_v * (R(1, k) - y * R(2, k));
    }
    for (int k = 0; k < 3; ++k) {
      const int m = (k + 1) % 3, n = (k + 2) % 3;
      ju[3 + k] = p[m] * ju[n] - p[n] * ju[m];
      jv[3 + k] = p[m] * jv[n] - p[n] * jv[m];
    }
    for (int i = 0; i < 6; ++i) {
      const Lanes wu = weight * ju[i], wv = weight * jv[i];
      for (int k = 0; k <= i; ++k) H[i][k] += wu * ju[k] + wv * jv[k];
      g[i] += wu * residual_u + wv * residual_v;
    }
    cost += weight * (residual_u * residual_u + residual_v * residual_v);
  }
  for (int i = 0; i < 6; ++i) {
    sum.g[i] += g[i].sum();
    for (int k = 0; k <= i; ++k) sum.H_data(k, i) = sum.H_data(i, k) += H[i][k].sum();
  }
  sum.cost_px2 += cost.sum();
}

double kernelWeight(const IterativePnpSettings& settings, double distance2_px2, double scale_px) {
  if (settings.kernel == Kernel::kGaussian) return std::exp(-distance2_px2 / (2 * scale_px * scale_px));
  if (settings.kernel == Kernel::kL2) return 1;
  const double distance_px = std::sqrt(distance2_px2);
  return distance_px <= settings.huber_px ? 1.0 : settings.huber_px / distance_px;
}

}  // namespace

void projectPoints(const Eigen::Matrix3Xd& points_centered, const XrayView& view, const Pose& T_camera_centered,
                   OutsideImage outside, Projected& projected) {
  const Pose T_view_centered = view.T_view_first * T_camera_centered;
  for (Eigen::Index i = 0; i < points_centered.cols(); ++i) {
    const auto pixel = view.camera.project(T_view_centered * points_centered.col(i));
    projected.may_pull[i] = pixel.has_value() && (outside == OutsideImage::kVote || view.sees(*pixel));
    if (pixel) projected.pixel.col(i) = *pixel;
  }
}

NormalEquations normalEquations(const Eigen::Matrix3Xd& points_centered, const XrayViews& views,
                                const Pose& T_camera_centered, const std::vector<Pull>& pulls,
                                const PosePriorTerm& prior) {
  NormalEquations n;
  for (std::size_t v = 0; v < views.size(); ++v) {
    addView(points_centered, views[v].camera, views[v].T_view_first * T_camera_centered, pulls[v], n);
  }
  n.H = n.H_data;
  prior.add(T_camera_centered, n.H, n.g);
  n.cost_px2 += prior.cost(T_camera_centered);
  return n;
}

double irlsCost(const Eigen::Matrix3Xd& points_centered, const XrayViews& views, const Pose& T_camera_centered,
                const std::vector<Pull>& pulls, const PosePriorTerm& prior) {
  double cost = prior.cost(T_camera_centered);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Pose T_view_centered = views[v].T_view_first * T_camera_centered;
    const Pull& pull = pulls[v];
    for (Eigen::Index i = 0; i < points_centered.cols(); ++i) {
      if (pull.weight[i] == 0) continue;
      const auto pixel = views[v].camera.project(T_view_centered * points_centered.col(i));
      // A step that pushes a matched point behind the source is no step.
      if (!pixel) return std::numeric_limits<double>::infinity();
      cost += pull.weight[i] * (*pixel - pull.target_px.col(i)).squaredNorm();
    }
  }
  return cost;
}

LevenbergMarquardt::Step LevenbergMarquardt::step(const Eigen::Matrix3Xd& points_centered, const XrayViews& views,
                                                  const Pose& T_camera_centered, const std::vector<Pull>& pulls,
                                                  const PosePriorTerm& prior) {
  const auto n = normalEquations(points_centered, views, T_camera_centered, pulls, prior);
  Step step{T_camera_centered};
  step.lowered = damping_.step([&](double damping) {
    Matrix6d damped = n.H;
    damped.diagonal() += damping * n.H.diagonal() + Vector6d::Constant(1e-12);
    const Twist dx = -solveSymmetric(damped, n.g);
    if (!dx.allFinite()) return false;
    Pose trial = T_camera_centered * expSE3(dx);
    trial.linear() = nearestRotation(trial.linear());
    if (!(irlsCost(points_centered, views, trial, pulls, prior) <= n.cost_px2)) return false;
    step.T_camera_centered = trial;
    step.dx = dx;
    return true;
  });
  return step;
}

void matchNearest(const Projected& projected, const PointMatcher& image, Pull& pull) {
  double largest2 = 0;
  for (std::size_t i = 0; i < pull.nearest.size(); ++i) {
    if (!projected.may_pull[i] || image.size() == 0) {
      pull.weight[i] = 0;
      pull.nearest[i] = -1;
      continue;
    }
    const auto match = image.nearest(projected.pixel.col(i), pull.nearby[i]);
    pull.nearest[i] = match.index;
    pull.target_px.col(i) = image.point(match.index);
    pull.weight[i] = 1;
    largest2 = std::max(largest2, match.distance2_px2);
  }
  pull.max_distance_px = std::sqrt(largest2);
}

void weigh(const Projected& projected, const PointMatcher& image, const std::vector<int>& branch,
           const IterativePnpSettings& settings, double scale_px, Pull& pull) {
  pull.weighted_squares_px2 = 0;
  const int each_side = branch.empty() ? 0 : settings.neighbours_each_side;
  for (std::size_t i = 0; i < pull.nearest.size(); ++i) {
    const int nearest = pull.nearest[i];
    if (nearest < 0) continue;
    const Eigen::Vector2d pixel = projected.pixel.col(i);
    const double distance2 = (pixel - image.point(nearest)).squaredNorm();
    double sum = kernelWeight(settings, distance2, scale_px);
    Eigen::Vector2d weighted = sum * image.point(nearest);
    const int first = std::max(0, nearest - each_side), last = std::min(image.size() - 1, nearest + each_side);
    for (int j = first; j <= last; ++j) {
      if (j == nearest || branch[j] != branch[nearest]) continue;
      const double w = kernelWeight(settings, (pixel - image.point(j)).squaredNorm(), scale_px);
      sum += w;
      weighted += w * image.point(j);
    }
    pull.weight[i] = sum;
    pull.weighted_squares_px2 += sum * distance2;
    // A weight that has underflowed pulls nowhere.
    if (sum > 0) pull.target_px.col(i) = weighted / sum;
  }
}

}  // namespace angio::registration

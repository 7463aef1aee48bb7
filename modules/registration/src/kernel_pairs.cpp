// SPDX-License-Identifier: GPL-2.0-or-later
#include "kernel_pairs.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {
namespace {

// Pieces of half a scale make the same sums as finer ones, and are not finer than pixels.
constexpr double kPieceShare = 0.5, kMinPiece_px = 1;

using PixelSeries = Eigen::Matrix<double, 2, 4>;  // Columns: coefficients of t, t^2, t^3, t^4.

// Series of the pixel of a point p along T exp(t xi).
PixelSeries pixelSeries(const XrayCamera& camera, const Pose& T_view_centered, const Eigen::Vector3d& p,
                        const Twist& xi) {
  const Eigen::Vector3d v = xi.head<3>(), w = xi.tail<3>();
  // exp(t xi) p: each coefficient is the twist applied to the one before.
  Eigen::Matrix<double, 3, 5> P;
  P.col(0) = T_view_centered * p;
  Eigen::Vector3d term = v + w.cross(p);
  for (int k = 1; k <= 4; ++k) {
    P.col(k) = T_view_centered.linear() * term;
    term = w.cross(term) / (k + 1);
  }
  // The quotient q of two series a and z: q_k = (a_k - sum over m > 0 of z_m q_(k-m)) / z_0.
  Eigen::Matrix<double, 2, 5> q;
  for (int k = 0; k <= 4; ++k) {
    q.col(k) = P.col(k).head<2>();
    for (int m = 1; m <= k; ++m) q.col(k) -= P(2, m) * q.col(k - m);
    q.col(k) /= P(2, 0);
  }
  const auto& c = camera.parameters();
  return Eigen::Vector2d(c.fx_px, c.fy_px).asDiagonal() * q.rightCols<4>();
}

// Adds weight times the series of exp(-(|apart + sum u_k t^k|^2 - |apart|^2) / 2 l^2).
void addKernelSeries(double weight, double inverse_2l2, const Eigen::Vector2d& apart, const PixelSeries& u,
                     std::array<double, 4>& sum) {
  const double b = -inverse_2l2 * 2 * apart.dot(u.col(0));
  const double c = -inverse_2l2 * (u.col(0).squaredNorm() + 2 * apart.dot(u.col(1)));
  const double d = -inverse_2l2 * 2 * (apart.dot(u.col(2)) + u.col(0).dot(u.col(1)));
  const double e = -inverse_2l2 * (u.col(1).squaredNorm() + 2 * (apart.dot(u.col(3)) + u.col(0).dot(u.col(2))));
  sum[0] += weight * b;
  sum[1] += weight * (c + b * b / 2);
  sum[2] += weight * (d + b * c + b * b * b / 6);
  sum[3] += weight * (e + b * d + c * c / 2 + b * b * c / 2 + b * b * b * b / 24);
}

// Pixel's Jacobian with respect to dx, T exp(dx).
Eigen::Matrix<double, 2, 6> pixelJacobian(const XrayView& view, const Pose& T_view_centered, const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 2, 3> J;
  Eigen::Matrix<double, 2, 6> of_twist;
  if (!view.camera.project(T_view_centered * p, &J)) return of_twist.setZero();
  of_twist.leftCols<3>() = J * T_view_centered.linear();
  of_twist.rightCols<3>() = -of_twist.leftCols<3>() * skew(p);
  return of_twist;
}

}  // namespace

PairKernel::PairKernel(double scale, double direction_std_rad, CvoObjective objective)
    : of_distance(objective == CvoObjective::kDistance),
      scale_px(scale),
      inverse_2l2(1 / (2 * scale * scale)),
      // cos 2a - 1 is -2 a^2 for small angles a.
      kappa(1 / (4 * direction_std_rad * direction_std_rad)),
      reach_px(scale * std::sqrt(-2 * std::log(kMinKernel))) {}

FlowView::FlowView(const ModelSamples& model, const XrayView& seen, const Pose& T_camera_centered,
                   const PairKernel& kernel, double match_m)
    : view(&seen), image(imageSamples(seen.centerline, std::max(kMinPiece_px, kPieceShare * kernel.scale_px))) {
  image_grid.build(image.points_px);
  points.resize(3, model.size());
  direction.resize(2, model.size());
  length_px.resize(model.size());
  matches.resize(model.size());
  const Pose T_view_centered = seen.T_view_first * T_camera_centered;
  Eigen::Index n = 0;
  for (int i = 0; i < model.size(); ++i) {
    Eigen::Matrix<double, 2, 3> J;
    const auto pixel = seen.camera.project(T_view_centered * model.points.col(i), &J);
    if (!pixel || !seen.sees(*pixel)) continue;
    const Eigen::Vector2d run = J * T_view_centered.linear() * model.tangents.col(i);
    const double run2 = run.squaredNorm();
    if (!(run2 > 0)) continue;  // Seen end-on: no length, no direction.
    points.col(n) = model.points.col(i);
    direction.col(n) << (run.x() * run.x() - run.y() * run.y()) / run2, 2 * run.x() * run.y() / run2;
    of_model.push_back(i);
    matches[n] = model.length_m[i] / match_m;
    length_px[n] = std::sqrt(run2) * model.length_m[i];
    ++n;
  }
  points.conservativeResize(3, n);
  direction.conservativeResize(2, n);
  length_px.conservativeResize(n);
  matches.conservativeResize(n);
  // A line through a piece, in the kernel's view: the integral of exp(-s^2 / 2 l^2) is sqrt(2 pi) l.
  const double line_px = std::sqrt(2 * kPi) * kernel.scale_px;
  if (n > 0) unit = matches.sum() / (length_px.sum() * line_px);
}

bool alignView(const FlowView& view, const Pose& T_camera_centered, const PairKernel& kernel, ViewAlignment& to) {
  const int n = view.size();
  const Pose T_view_centered = view.view->T_view_first * T_camera_centered;
  to.pixel.resize(2, n);
  to.force.setZero(2, n);
  to.value_px2 = 0;
  to.image_pairs.clear();
  to.model_pairs.clear();
  for (int i = 0; i < n; ++i) {
    const auto pixel = view.view->camera.project(T_view_centered * view.points.col(i));
    if (!pixel || !pixel->allFinite()) return false;
    to.pixel.col(i) = *pixel;
  }
  if (kernel.of_distance) to.model_grid.build(to.pixel);
  double image_sum = 0, model_sum = 0;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d at = to.pixel.col(i), along = view.direction.col(i);
    const double mass = view.unit * view.length_px[i];
    // x and y are from the model's piece to the other one.
    const auto kernelOf = [&](const Eigen::Vector2d& other, double x, double y) {
      return std::exp(-kernel.inverse_2l2 * (x * x + y * y) + kernel.kappa * (along.dot(other) - 1));
    };
    view.image_grid.eachWithin(at, kernel.reach_px, [&](int j, double x, double y) {
      const double k = kernelOf(view.image.direction.col(j), x, y);
      if (k <= PairKernel::kMinKernel) return;
      const double masses = mass * view.image.length_px[j], weight = masses * k;
      image_sum += weight - masses * PairKernel::kMinKernel;
      to.force.col(i) += 2 * weight * Eigen::Vector2d(x, y);
      to.image_pairs.push_back({i, j, weight, {-x, -y}});
    });
    if (!kernel.of_distance) continue;
    to.model_grid.eachWithin(at, kernel.reach_px, [&](int j, double x, double y) {
      if (j <= i) return;
      const double k = kernelOf(view.direction.col(j), x, y);
      if (k <= PairKernel::kMinKernel) return;
      const double masses = mass * view.length_px[j], weight = masses * k;
      model_sum += weight - masses * PairKernel::kMinKernel;
      to.force.col(i) -= 2 * weight * Eigen::Vector2d(x, y);
      to.force.col(j) += 2 * weight * Eigen::Vector2d(x, y);
      to.model_pairs.push_back({i, j, weight, {-x, -y}});
    });
  }
  to.value_px2 = (image_sum - model_sum) / kernel.inverse_2l2;
  return true;
}

Vector6d twistGradient(const FlowView& view, const Pose& T_camera_centered, const ViewAlignment& alignment) {
  const Pose T_view_centered = view.view->T_view_first * T_camera_centered;
  Vector6d gradient = Vector6d::Zero();
  for (int i = 0; i < view.size(); ++i) {
    gradient += pixelJacobian(*view.view, T_view_centered, view.points.col(i)).transpose() * alignment.force.col(i);
  }
  return gradient;
}

void addPictureMetric(const FlowView& view, const Pose& T_camera_centered, Matrix6d& metric) {
  const Pose T_view_centered = view.view->T_view_first * T_camera_centered;
  for (int i = 0; i < view.size(); ++i) {
    const auto J = pixelJacobian(*view.view, T_view_centered, view.points.col(i));
    metric.noalias() += view.matches[i] * J.transpose() * J;
  }
}

Pull pullOf(const FlowView& view, int model_size, const ViewAlignment& alignment) {
  Pull pull(model_size);
  for (const KernelPair& pair : alignment.image_pairs) {
    const int i = view.of_model[static_cast<std::size_t>(pair.i)];
    pull.weight[i] += pair.weight;
    pull.target_px.col(i) += pair.weight * view.image.points_px.col(pair.j);
  }
  for (int k = 0; k < view.size(); ++k) {
    const int i = view.of_model[static_cast<std::size_t>(k)];
    if (!(pull.weight[i] > 0)) continue;
    pull.target_px.col(i) /= pull.weight[i];
    // The distance to a curve is one residual, where covarianceOf() counts two a point.
    pull.weighted_squares_px2 += 2 * pull.weight[i] * view.image_grid.nearest(alignment.pixel.col(k)).distance2_px2;
  }
  return pull;
}

std::array<double, 4> taylorAlong(const FlowView& view, const Pose& T_camera_centered, const Twist& xi,
                                  const PairKernel& kernel, const ViewAlignment& alignment) {
  const Pose T_view_centered = view.view->T_view_first * T_camera_centered;
  std::vector<PixelSeries> series(static_cast<std::size_t>(view.size()));
  for (int i = 0; i < view.size(); ++i) {
    series[static_cast<std::size_t>(i)] = pixelSeries(view.view->camera, T_view_centered, view.points.col(i), xi);
  }
  std::array<double, 4> sum{};
  for (const KernelPair& pair : alignment.image_pairs) {
    addKernelSeries(pair.weight, kernel.inverse_2l2, pair.apart_px, series[static_cast<std::size_t>(pair.i)], sum);
  }
  for (const KernelPair& pair : alignment.model_pairs) {
    const PixelSeries between = series[static_cast<std::size_t>(pair.i)] - series[static_cast<std::size_t>(pair.j)];
    addKernelSeries(-pair.weight, kernel.inverse_2l2, pair.apart_px, between, sum);
  }
  for (double& coefficient : sum) coefficient /= kernel.inverse_2l2;
  return sum;
}

}  // namespace angio::registration

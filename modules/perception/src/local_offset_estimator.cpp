// SPDX-License-Identifier: GPL-2.0-or-later
#include "local_offset_estimator.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace angio::perception {
namespace {

constexpr double kSpacing_m = 0.5e-3;
constexpr double kMaxTurn_rad = 0.5;  // Between a vessel and what may be it.
constexpr double kFirstGate = 2.5;    // Of the prior's standard deviation.
constexpr double kScale_px = 3;       // Residuals beyond it count less and less, in the end.
constexpr double kCorrelated_px = 8;  // Neighbouring points of a seen vessel err alike.
constexpr double kFloor_px = 0.3;     // What a curve is off as a whole: radius, overlap, contrast.
constexpr int kIterations = 8, kNarrowIterations = 5;
constexpr double kUsualError_px = 1;  // Of a curve that has been matched rightly.
constexpr double kOff = 0.02;         // Probability that a place lies off where a converged fit has it.

// The place's vessels in the image.
struct Vessels {
  Eigen::Matrix2Xd points;
  Eigen::VectorXd tangent, weight;
};

// One way to lay them on what is seen.
struct Laid {
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  Eigen::Matrix2d information;
  double matched = 0;  // Weight of the points that found something.
  double cost = 0;     // Twice the negative logarithm of how likely it is, up to a constant.
};

// What may be matched: the seen points around the target, from left to right.
struct Seen {
  Eigen::Matrix2Xd points, normals;
  Eigen::VectorXd tangent, variance;
};

Seen around(const Centerline2d& line, const Eigen::Vector2d& center, double reach_px) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < line.points_px.cols(); ++i) {
    if ((line.points_px.col(i) - center).squaredNorm() < reach_px * reach_px) kept.push_back(i);
  }
  std::sort(kept.begin(), kept.end(),
            [&](Eigen::Index a, Eigen::Index b) { return line.points_px(0, a) < line.points_px(0, b); });
  const auto n = static_cast<Eigen::Index>(kept.size());
  Seen seen{Eigen::Matrix2Xd(2, n), Eigen::Matrix2Xd(2, n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index i = kept[k];
    seen.points.col(k) = line.points_px.col(i);
    seen.tangent[k] = line.tangent_rad[i];
    seen.normals.col(k) << -std::sin(seen.tangent[k]), std::cos(seen.tangent[k]);
    const double sigma = line.std_px.size() > 0 ? std::max(line.std_px[i], 0.1) : 1.0;
    seen.variance[k] = sigma * sigma;
  }
  return seen;
}

// The nearest one that runs the same way; -1: none within the gate.
Eigen::Index match(const Seen& seen, const Eigen::Vector2d& at, double tangent_rad, double gate_px) {
  const auto x = seen.points.row(0);
  const Eigen::Index first = std::lower_bound(x.begin(), x.end(), at.x() - gate_px) - x.begin();
  Eigen::Index best = -1;
  double best_squared = gate_px * gate_px;
  for (Eigen::Index k = first; k < seen.points.cols() && seen.points(0, k) <= at.x() + gate_px; ++k) {
    const double squared = (seen.points.col(k) - at).squaredNorm();
    if (squared >= best_squared || std::abs(undirected(seen.tangent[k] - tangent_rad)) > kMaxTurn_rad) continue;
    best = k;
    best_squared = squared;
  }
  return best;
}

// From where the registration puts them to the nearest way that they lie on what is seen: looked for at a scale that
// is halved from step to step, from the whole of what may be meant to what is meant.
Laid laidFrom(const Vessels& vessels, const Seen& seen, double prior_px, double first_scale_px, int iterations) {
  const Eigen::Matrix2d prior = Eigen::Matrix2d::Identity() / (prior_px * prior_px);
  Laid laid;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const double scale_px = std::max(kScale_px, first_scale_px * std::pow(0.5, iteration));
    laid.information = prior;
    laid.matched = 0;
    Eigen::Vector2d pull = Eigen::Vector2d::Zero();
    for (Eigen::Index k = 0; k < vessels.points.cols(); ++k) {
      const Eigen::Index i = match(seen, vessels.points.col(k) + laid.shift, vessels.tangent[k], 2 * scale_px);
      if (i < 0) continue;
      const Eigen::Vector2d normal = seen.normals.col(i);
      const double off = normal.dot(seen.points.col(i) - vessels.points.col(k));
      const double residual = (off - normal.dot(laid.shift)) / scale_px, kept = 1 / (1 + residual * residual);
      const double w = vessels.weight[k] * kept * kept / (seen.variance[i] + kFloor_px * kFloor_px);
      laid.information += w * normal * normal.transpose();
      pull += w * off * normal;
      laid.matched += vessels.weight[k];
    }
    laid.shift = laid.information.inverse() * pull;
  }
  return laid;
}

// How badly they lie: Geman and McClure's cost of the distances, which no point exceeds that finds nothing, and the
// prior's. How sure each seen point is does not count: a sure neighbour is no better a match than an unsure vessel.
double costOf(const Laid& laid, const Vessels& vessels, const Seen& seen, double prior_px) {
  constexpr double kMaxCost = kScale_px * kScale_px / (kUsualError_px * kUsualError_px);
  double cost = laid.shift.squaredNorm() / (prior_px * prior_px);
  for (Eigen::Index k = 0; k < vessels.points.cols(); ++k) {
    const Eigen::Vector2d at = vessels.points.col(k) + laid.shift;
    const Eigen::Index i = match(seen, at, vessels.tangent[k], 2 * kScale_px);
    const double residual = i < 0 ? 0 : seen.normals.col(i).dot(seen.points.col(i) - at) / kScale_px;
    cost += kMaxCost * vessels.weight[k] * (i < 0 ? 1 : residual * residual / (1 + residual * residual));
  }
  return cost;
}

// That the place lies off where the fit has it. A shift that may go anywhere within the prior explains an image better
// than none does, whether or not there is one, so that its evidence is compared: its cost and, by Laplace, how much of
// the prior it leaves.
double probabilityOff(const Laid& laid, const Vessels& vessels, const Seen& seen, double prior_px) {
  const double occam = std::log((laid.information * prior_px * prior_px).determinant());
  Laid fit = laid;
  fit.shift.setZero();
  const double against = laid.cost + occam - costOf(fit, vessels, seen, prior_px);
  return kOff / (kOff + (1 - kOff) * std::exp(0.5 * against));
}

}  // namespace

LocalOffsetEstimator::LocalOffsetEstimator(const VesselTree& tree, const PointOfInterest& place) : place_(place) {
  const double near_m = place.near_m;
  std::vector<Eigen::Vector3d> points, tangents;
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[i];
    if (parent < 0) continue;
    const Eigen::Vector3d a = tree.points().col(parent), step = tree.points().col(i) - a;
    const int pieces = std::max(1, static_cast<int>(std::ceil(step.norm() / kSpacing_m)));
    for (int k = 1; k <= pieces; ++k) {
      const Eigen::Vector3d p = a + step * k / pieces;
      if ((p - place_.model).norm() > near_m || !(step.norm() > 0)) continue;
      points.push_back(p);
      tangents.push_back(step.normalized());
    }
  }
  const auto n = static_cast<Eigen::Index>(points.size());
  points_.resize(3, n);
  tangents_.resize(3, n);
  weight_.resize(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    points_.col(k) = points[k];
    tangents_.col(k) = tangents[k];
    weight_[k] = std::exp(-2 * (points_.col(k) - place_.model).squaredNorm() / (near_m * near_m));
  }
}

std::optional<ImageShift> LocalOffsetEstimator::observe(const Centerline2d& centerline, const XrayCamera& camera,
                                                        const Pose& T_camera_model) const {
  const Eigen::Vector3d target_camera = T_camera_model * place_.model;
  const auto target_px = camera.project(target_camera);
  if (!target_px || points_.cols() == 0 || centerline.size() == 0) return std::nullopt;
  const double px_per_m = camera.parameters().fx_px / target_camera.z();
  const double prior_px = place_.std_m * px_per_m, first_gate_px = kFirstGate * prior_px;

  Vessels vessels{Eigen::Matrix2Xd(2, points_.cols()), Eigen::VectorXd(points_.cols()), weight_};
  double reach_px = 0;
  for (Eigen::Index k = 0; k < points_.cols(); ++k) {
    Eigen::Matrix<double, 2, 3> J;
    const auto pixel = camera.project(T_camera_model * points_.col(k), &J);
    if (!pixel) return std::nullopt;
    const Eigen::Vector2d along = J * (T_camera_model.linear() * tangents_.col(k));
    vessels.points.col(k) = *pixel;
    vessels.tangent[k] = std::atan2(along.y(), along.x());
    // A vessel that points along the beam has no direction in the image and few pixels.
    vessels.weight[k] *= std::min(1.0, along.norm() / px_per_m) * kSpacing_m * px_per_m / kCorrelated_px;
    reach_px = std::max(reach_px, (*pixel - *target_px).norm());
  }
  const Seen seen = around(centerline, *target_px, reach_px + first_gate_px);

  // What is wide of the place draws to a neighbour now and then; what is narrow misses a place that is far off.
  Laid best = laidFrom(vessels, seen, prior_px, 0.5 * first_gate_px, kIterations);
  Laid other = laidFrom(vessels, seen, prior_px, kScale_px, kNarrowIterations);
  for (Laid* laid : {&best, &other}) {
    if (!laid->shift.allFinite()) return std::nullopt;
    laid->cost = costOf(*laid, vessels, seen, prior_px);
  }
  if (other.cost < best.cost) std::swap(best, other);
  if (best.matched <= 0) return std::nullopt;
  const Eigen::Matrix2d floor = kFloor_px * kFloor_px * Eigen::Matrix2d::Identity();
  const double off = probabilityOff(best, vessels, seen, prior_px);
  const Eigen::Matrix2d covariance = best.information.inverse() + floor;
  ImageShift result{off * best.shift, covariance, off, best.shift, covariance};
  // Where it might as well be the other one, or where the fit has it, that is said.
  const double others = off / (1 + std::exp(0.5 * (other.cost - best.cost)));
  const Eigen::Vector2d apart = other.shift - best.shift;
  result.covariance_px += others * apart * apart.transpose() + off * (1 - off) * best.shift * best.shift.transpose();
  return result;
}

}  // namespace angio::perception

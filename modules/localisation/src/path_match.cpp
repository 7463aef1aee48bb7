// SPDX-License-Identifier: GPL-2.0-or-later
#include "path_match.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace angio::localisation {
namespace {

constexpr double kOutsideShare = 0.5;  // A point beyond the root costs this share of a stray one.
constexpr double kDetour = 0.03;       // Price of walking further or less far than the curve did.
constexpr int kMaxEdges = 80;          // In one step: vessels along the beam have many places on one pixel.

// The nearest point of an edge to q.
struct Foot {
  double weight;
  double squared_px;
};

Foot footOn(const Eigen::Vector2d& from, const Eigen::Vector2d& along, const Eigen::Vector2d& q, double lowest_weight) {
  const double squared = along.squaredNorm();
  const double weight = squared > 0 ? std::clamp(along.dot(q - from) / squared, lowest_weight, 1.0) : 1.0;
  return {weight, (q - from - weight * along).squaredNorm()};
}

// Across the edge; at a corner, or where the edge points into the beam, towards q.
Eigen::Vector2d normalAt(const Eigen::Vector2d& along, const Eigen::Vector2d& offset, double weight) {
  const double length = along.norm();
  if ((weight > 0 && weight < 1 && length > 1e-6) || offset.norm() < 0.5) {
    return length > 1e-6 ? Eigen::Vector2d(-along.y() / length, along.x() / length) : Eigen::Vector2d::UnitX();
  }
  return offset.normalized();
}

double pathLength_px(const Eigen::Matrix2Xd& points) {
  double length = 0;
  for (int i = 1; i < points.cols(); ++i) length += (points.col(i) - points.col(i - 1)).norm();
  return length;
}

}  // namespace

void PathMatcher::prepare(const Eigen::Matrix2Xd& projected_px, const CurveSamples& curve, int stride) {
  projected_ = &projected_px;
  curve_ = &curve;
  stride_ = stride;
  step_px_ = curve.step_px * stride;
  std_px_ = std::hypot(settings_.model_std_px, curve.std_px);
  tip_variance_ = settings_.tip_std_px * settings_.tip_std_px + std_px_ * std_px_;
  // Neighbouring points err together, so that each counts for its share of a correlation length.
  share_ = std::min(1.0, step_px_ / settings_.correlation_px);
}

Eigen::Vector2d PathMatcher::observedPoint(const Eigen::Vector2d& sample, const Eigen::Vector2d& tip,
                                           const Misfit& misfit) const {
  const Eigen::Vector2d v = sample - misfit.head<2>() - tip;
  return tip + (1 - misfit[2]) * v - misfit[3] * Eigen::Vector2d(-v.y(), v.x());
}

// The nearest point of the path to q, ahead of `from`, about as far along as the curve has gone.
PathMatcher::Step PathMatcher::ahead(const Position& from, const Eigen::Vector2d& q, double expected_px) const {
  const Eigen::Matrix2Xd& U = *projected_;
  const double max_px = 2.5 * expected_px + 10;
  double walked_px = 0, lowest_weight = from.weight, best_cost = std::numeric_limits<double>::infinity();
  Step best;
  int at = from.place;
  for (int k = 0; k < kMaxEdges && walked_px < max_px; ++k) {
    const int parent = grid_.parent[at];
    if (parent < 0) break;
    const Eigen::Vector2d along = U.col(parent) - U.col(at);
    const double length_px = along.norm();
    const Foot foot = footOn(U.col(at), along, q, lowest_weight);
    const double surplus_px = walked_px + (foot.weight - lowest_weight) * length_px - expected_px;
    const double cost = foot.squared_px + kDetour * surplus_px * surplus_px;
    if (cost < best_cost) {
      best_cost = cost;
      best.to = {at, foot.weight};
      best.squared_px = foot.squared_px;
      best.beyond_root = grid_.parent[parent] < 0 && foot.weight >= 1 && along.dot(q - U.col(parent)) > 0;
    }
    walked_px += (1 - lowest_weight) * length_px;
    lowest_weight = 0;
    at = parent;
  }
  return best;
}

// Walks curve and path together, from the tip to the root; returns the energy of the curve's points without the tip's.
double PathMatcher::walk(int place, const Misfit& misfit) {
  const Eigen::Matrix2Xd& U = *projected_;
  const Eigen::Vector2d tip = U.col(place);
  const double outlier_sq = settings_.outlier_px * settings_.outlier_px;
  const double most = 0.5 * outlier_sq / (std_px_ * std_px_) * share_;  // Geman-McClure's bound.
  const int count = static_cast<int>(curve_->points_px.size());
  matches_.clear();
  distance_sum_px_ = 0;
  double energy = 0;
  Position at{place, 0};
  int missed = 0, sample = stride_;
  for (; sample < count && grid_.parent[at.place] >= 0; sample += stride_) {
    const Eigen::Vector2d q = observedPoint(curve_->points_px[sample], tip, misfit);
    const Step step = ahead(at, q, step_px_ * (missed + 1));
    if (step.beyond_root) break;
    energy += most * step.squared_px / (step.squared_px + outlier_sq);
    distance_sum_px_ += std::sqrt(step.squared_px);
    const double trust = outlier_sq / (step.squared_px + outlier_sq);
    const Eigen::Vector2d along = U.col(grid_.parent[step.to.place]) - U.col(step.to.place);
    const Eigen::Vector2d offset = q - U.col(step.to.place) - step.to.weight * along;
    const Eigen::Vector2d normal = normalAt(along, offset, step.to.weight);
    matches_.push_back({sample, step.to.place, step.to.weight, normal, normal.dot(offset), trust * trust});
    const bool outlier = step.squared_px > outlier_sq;
    missed = outlier ? missed + 1 : 0;
    if (!outlier) at = step.to;
  }
  const int outside = sample < count ? (count - 1 - sample) / stride_ + 1 : 0;
  return energy + outside * kOutsideShare * most;
}

// Normal equations of the prior, the tip, and the matched points.
PathMatcher::Equations PathMatcher::equations(int place, const Misfit& x, const MisfitPrior& prior) const {
  const Eigen::Vector2d tip = projected_->col(place);
  Equations e{prior.information, prior.information * (x - prior.mean)};
  const auto jacobian = [&](const Eigen::Vector2d& q) {
    const Eigen::Vector2d v = q - x.head<2>() - tip;
    Eigen::Matrix<double, 2, 4> J;
    J << -(1 - x[2]), -x[3], -v.x(), v.y(), x[3], -(1 - x[2]), -v.y(), -v.x();
    return J;
  };
  const Eigen::Vector2d& seen_tip = curve_->points_px.front();
  const Eigen::Matrix<double, 2, 4> J_tip = jacobian(seen_tip);
  e.H.noalias() += J_tip.transpose() * J_tip / tip_variance_;
  e.g.noalias() += J_tip.transpose() * (observedPoint(seen_tip, tip, x) - tip) / tip_variance_;
  for (const SampleMatch& m : matches_) {
    const Eigen::Vector4d j = jacobian(curve_->points_px[m.sample]).transpose() * m.normal;
    const double w = m.trust * share_ / (std_px_ * std_px_);
    e.H.noalias() += w * j * j.transpose();
    e.g.noalias() += w * m.distance_px * j;
  }
  return e;
}

PathMatch PathMatcher::match(int place, const MisfitPrior& prior, int iterations, const std::optional<Misfit>& start) {
  // The tip and the prior alone make the first guess, which the points of the curve then correct.
  Misfit x = start.value_or(prior.mean);
  Equations e;
  matches_.clear();
  for (int k = start ? 1 : 0; k <= iterations; ++k) {
    if (k > 0) walk(place, x);
    e = equations(place, x, prior);
    x -= e.H.ldlt().solve(e.g);
  }
  const double curve_energy = walk(place, x);
  const Eigen::Vector2d tip = projected_->col(place);
  const double tip_px = (observedPoint(curve_->points_px.front(), tip, x) - tip).norm();
  const Misfit off = x - prior.mean;
  const double energy = curve_energy + 0.5 * off.dot(prior.information * off) + 0.5 * tip_px * tip_px / tip_variance_;
  const Eigen::LLT<Eigen::Matrix4d> llt(e.H), prior_llt(prior.information);
  double log_ratio = 0;  // Half the logarithm of det(prior information) / det(H).
  for (int i = 0; i < 4; ++i) log_ratio += std::log(prior_llt.matrixL()(i, i) / llt.matrixL()(i, i));
  PathMatch result;
  result.misfit = x;
  result.covariance = llt.solve(Eigen::Matrix4d::Identity());
  result.log_evidence = log_ratio - energy;
  result.residual_px = (distance_sum_px_ + tip_px) / (matches_.size() + 1.0);
  return result;
}

std::optional<std::string> defectOf(const SeenCatheter& seen) {
  if (seen.points_px.cols() < 2) return "the curve has fewer than two points";
  if (!seen.points_px.allFinite() || seen.points_px.cwiseAbs().maxCoeff() > 1e6)
    return "a point of the curve is not finite or absurd";
  if (!(seen.std_px > 0) || !std::isfinite(seen.std_px)) return "the curve's sigma is not positive";
  if (!(pathLength_px(seen.points_px) > 1)) return "the curve has no length";
  return std::nullopt;
}

CurveSamples samplesOf(const SeenCatheter& seen, double step_px, bool tip_is_last) {
  const Eigen::Matrix2Xd points = tip_is_last ? seen.points_px.rowwise().reverse().eval() : seen.points_px;
  CurveSamples samples;
  samples.std_px = seen.std_px;
  samples.length_px = pathLength_px(points);
  samples.step_px = std::max(step_px, samples.length_px / kMaxSamples);
  double next = 0, walked = 0;
  for (int i = 1; i < points.cols(); ++i) {
    const Eigen::Vector2d from = points.col(i - 1), to = points.col(i);
    const double edge = (to - from).norm();
    for (; next <= walked + edge && edge > 0; next += samples.step_px) {
      samples.points_px.push_back(from + (to - from) * ((next - walked) / edge));
    }
    walked += edge;
  }
  return samples;
}

}  // namespace angio::localisation

// SPDX-License-Identifier: GPL-2.0-or-later
// How an elastic rod comes to rest between walls, and the forces there.
#include <algorithm>
#include <cmath>

#include "angio/rod/elastic_rod.hpp"
#include "banded_system.hpp"
#include "wall_friction.hpp"

namespace angio::rod {
namespace {

constexpr double kMaxMove_m = 1e-3, kMaxTurn_rad = 0.5;  // In one iteration: a point stays near its tube.
constexpr double kRest_m = 1e-7, kRest_rad = 1e-4;
constexpr int kIterations = 60;                      // For each round of friction.
constexpr int kRounds = 4;                           // Of friction by the wall's forces, and those by friction.
constexpr double kSame_n = 1e-3, kSameShare = 0.02;  // Friction that differs by less is the same.
// Of what compression takes from the stiffness across the rod: without all of it Newton's matrix is positive definite.
constexpr double kSoftening[] = {1, 0.7, 0};
constexpr double kArmijo = 1e-4, kShortestStep = 1e-3, kRoundOff = 1e-13;

double lengthOf(const Eigen::VectorXd& step, double unit_m, double unit_rad) {
  double most = 0;
  for (Eigen::Index k = 0; k < step.size(); k += 4) {
    most = std::max({most, std::abs(step[k]) / unit_rad, step.segment<3>(k + 1).norm() / unit_m});
  }
  return most;
}

bool isSame(const std::vector<SlidingPoint>& a, const std::vector<SlidingPoint>& b) {
  if (a.size() != b.size()) return false;
  double most = 0, off = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (a[k].point != b[k].point) return false;
    most = std::max(most, b[k].bound_n);
    off = std::max(off, std::abs(a[k].bound_n - b[k].bound_n));
  }
  return off < kSame_n + kSameShare * most;
}

}  // namespace

std::vector<WallGap> ElasticRod::gaps(const RodShape& shape) const {
  std::vector<WallGap> all(static_cast<std::size_t>(shape.size()));
  for (std::size_t i = 2; i < all.size(); ++i) {
    all[i] = lumen_.gapNear(tubes_[i], shape.points.col(static_cast<Eigen::Index>(i)), settings_.radius_m);
  }
  return all;
}

double ElasticRod::wall_n_m(Eigen::Index point) const {
  const double end_m = point + 1 == shape_.size() ? settings_.end_wall_m : 0.0;
  return settings_.wall_pa * (body_.share_m(point) + end_m);
}

double ElasticRod::energy(const RodShape& shape, const std::vector<WallGap>& gaps, Eigen::VectorXd* gradient,
                          BandedSystem* hessian) const {
  double energy = elasticEnergy(shape, body_, gradient, hessian) +
                  slidingEnergy(shape, sliding_, settings_.radius_m, gradient, hessian);
  for (Eigen::Index i = 2; i < shape.size(); ++i) {
    const WallGap& gap = gaps[static_cast<std::size_t>(i)];
    if (gap.gap_m >= 0) continue;
    const double stiffness = wall_n_m(i);
    energy += 0.5 * stiffness * gap.gap_m * gap.gap_m;
    const Eigen::Index at = RodShape::placeOf(i);
    if (gradient) gradient->segment<3>(at) += stiffness * gap.gap_m * gap.gradient;
    if (hessian) {
      hessian->add(at,
                   Eigen::Matrix3d(stiffness * (gap.gradient * gap.gradient.transpose() - gap.gap_m * gap.curvature)));
    }
  }
  energy -= load_n_.dot(shape.points.rightCols<1>());
  if (gradient) gradient->tail<3>() -= load_n_;
  return energy;
}

std::vector<SlidingPoint> ElasticRod::pressed() const {
  std::vector<SlidingPoint> points;
  if (settings_.friction == 0) return points;
  const std::vector<WallGap> now = gaps(shape_);
  const Eigen::Index last = shape_.size() - 1;
  for (Eigen::Index i = 2; i <= last; ++i) {
    const WallGap& gap = now[static_cast<std::size_t>(i)];
    if (gap.gap_m >= 0) continue;
    const Eigen::Vector3d along = (shape_.points.col(std::min(i + 1, last)) - shape_.points.col(i - 1)).normalized();
    const double slope = gap.gradient.norm();
    points.push_back(
        {i, from_.col(i), -gap.gradient / slope, along, settings_.friction * wall_n_m(i) * -gap.gap_m * slope});
  }
  return points;
}

// Friction needs the wall's forces, and they need friction: in turns.
void ElasticRod::rest() {
  for (int round = 0; round < kRounds; ++round) {
    effort_.at_rest = newton();
    if (from_.cols() == 0) return;
    std::vector<SlidingPoint> now = pressed();
    const bool same = isSame(sliding_, now);
    if (same) return;
    sliding_ = std::move(now);
  }
  effort_.at_rest = newton();
}

bool ElasticRod::newton() {
  BandedSystem hessian(shape_.freedoms());
  Eigen::VectorXd gradient(shape_.freedoms());
  for (int k = 0; k < kIterations; ++k) {
    ++effort_.iterations;
    std::vector<WallGap> now = gaps(shape_);
    for (std::size_t i = 2; i < now.size(); ++i) tubes_[i] = now[i].tube;
    for (const double softening : kSoftening) {
      gradient.setZero();
      hessian.clear(softening);
      effort_.energy_j = energy(shape_, now, &gradient, &hessian);
      if (hessian.factorise()) break;
    }
    Eigen::VectorXd step = -hessian.solve(gradient);
    if (const double most = lengthOf(step, kMaxMove_m, kMaxTurn_rad); most > 1) step /= most;
    if (lengthOf(step, kRest_m, kRest_rad) < 1) {
      shape_ = moved(shape_, step);  // A stiff rod's force is not yet right to a tenth of a micrometre.
      return true;
    }
    const double slope = gradient.dot(step);
    double share = 1;
    while (true) {
      RodShape trial = moved(shape_, share * step);
      const double reached = energy(trial, gaps(trial), nullptr, nullptr);
      if (reached <= effort_.energy_j + kArmijo * share * slope + kRoundOff * std::abs(effort_.energy_j)) {
        shape_ = std::move(trial);
        break;
      }
      if ((share *= 0.5) < kShortestStep) return false;
    }
  }
  return false;
}

TreeLocation ElasticRod::tip() const {
  const WallGap gap = gaps(shape_).back();
  return lumen_.place(gap.tube, gap.weight);
}

EdgePoint ElasticRod::edgePoint(Eigen::Index point) const {
  const WallGap gap =
      lumen_.gapNear(tubes_.at(static_cast<std::size_t>(point)), shape_.points.col(point), settings_.radius_m);
  return lumen_.edgePoint(gap.tube, gap.weight);
}

RodForces ElasticRod::forces() const {
  const Eigen::Index n = shape_.size();
  RodForces forces;
  forces.insertion_n = compression_n(shape_, body_, 1);
  forces.wall_n = Eigen::Matrix3Xd::Zero(3, n);
  const std::vector<WallGap> now = gaps(shape_);
  for (Eigen::Index i = 2; i < n; ++i) {
    const WallGap& gap = now[static_cast<std::size_t>(i)];
    if (gap.gap_m < 0) forces.wall_n.col(i) = -wall_n_m(i) * gap.gap_m * gap.gradient;
  }
  for (const SlidingPoint& s : sliding_) forces.wall_n.col(s.point) += friction_n(shape_, s, settings_.radius_m);
  const auto around = [&](Eigen::Index end) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double left_m = settings_.tip_length_m;
    for (Eigen::Index i = end; i >= 2 && left_m >= 0; left_m -= body_.lengths_m[--i]) sum += forces.wall_n.col(i);
    return sum.norm();
  };
  forces.tip_n = around(n - 1);
  for (Eigen::Index end = 2; end < n; ++end) forces.most_wall_n = std::max(forces.most_wall_n, around(end));
  return forces;
}

}  // namespace angio::rod

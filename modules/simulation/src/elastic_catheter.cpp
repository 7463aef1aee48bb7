// SPDX-License-Identifier: GPL-2.0-or-later
#include "elastic_catheter.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/se3.hpp"

namespace angio::simulation {
namespace {

// The drive's way after which the rod is brought to rest anew: some 20 ms of it.
constexpr double kLeastWay_m = 0.3e-3, kLeastWay_rad = 0.06;
constexpr double kSpacing = 0.5;       // Of the rod's points, in diameters.
constexpr double kMostWay_m = 0.6e-3;  // In one step of 5 ms: what bulged outside comes in no faster than that.

rod::RodSettings rodOf(const CatheterSettings& catheter) {
  const ElasticCatheterSettings& elastic = *catheter.elastic;
  rod::RodSettings rod;
  rod.radius_m = 0.5e-3 * catheter.diameter_mm;
  rod.shaft_bending_n_m2 = 1e-6 * elastic.shaft_bending_n_mm2;
  rod.tip_bending_n_m2 = 1e-6 * elastic.tip_bending_n_mm2;
  rod.soft_length_m = 1e-3 * elastic.soft_length_mm;
  rod.tip_length_m = 1e-3 * catheter.tip_length_mm;
  rod.bend_length_m = 0.4 * rod.tip_length_m;
  rod.tip_spacing_m = std::min(1e-3, 0.1 * rod.tip_length_m);
  rod.friction = elastic.wall_friction;
  rod.spacing_m = kSpacing * 1e-3 * catheter.diameter_mm;
  rod.tip_spacing_m = std::min(rod.tip_spacing_m, rod.spacing_m);
  return rod;
}

rod::RodStart startOf(const CatheterSettings& catheter, const TreeLocation& tip) {
  return {tip, degToRad(catheter.tip_angle_deg), degToRad(catheter.roll_zero_deg)};
}

}  // namespace

ElasticCatheter::ElasticCatheter(const VesselTree& tree, const CatheterSettings& settings, const TreeLocation& start)
    : settings_(settings),
      tree_(tree),
      drive_(Base::Zero()),
      followed_(Base::Zero()),
      rod_(rod::Lumen(tree_), rodOf(settings), startOf(settings, start)) {
  drive_[0] = followed_[0] = rod_.inserted_m();
  feel();
}

bool ElasticCatheter::settle(const Base& base) {
  const bool stops = base == drive_;
  drive_ = base;
  followed_[0] = followed(followed_[0], base[0], 0.5e-3 * settings_.insertion_backlash_mm);
  followed_[1] = followed(followed_[1], base[1], 0.5 * degToRad(settings_.roll_backlash_deg));
  followed_[2] = followed(followed_[2], base[2], 0.5 * degToRad(settings_.bend_backlash_deg));
  const Base left = followed_ - Base(rod_.inserted_m(), roll_rad_, bend_rad_);
  bulges_ = left[0] > 0 && forces_.insertion_n >= settings_.buckling_force_n;
  const double in_m = bulges_ ? 0.0 : std::clamp(left[0], -kMostWay_m, kMostWay_m);
  const bool far = std::abs(in_m) >= kLeastWay_m || left.tail<2>().cwiseAbs().maxCoeff() >= kLeastWay_rad;
  if (Base(in_m, left[1], left[2]).isZero() || !(far || stops)) return false;
  roll_rad_ += left[1];
  bend_rad_ += left[2];
  rod_.bend(degToRad(settings_.tip_angle_deg) + bend_rad_);
  rod_.move({in_m, left[1]});
  feel();
  return true;
}

void ElasticCatheter::feel() {
  forces_ = rod_.forces();
  felt_.feel(forces_.tip_n, forces_.insertion_n);
  const TreeFrame frame = rod_.lumen().map().frame(rod_.tip());
  const Eigen::Vector3d director = rod_.shape().directors.rightCols<1>();
  const double roll = std::atan2(director.dot(frame.binormal), director.dot(frame.normal));
  tip_roll_rad_ += std::remainder(roll - tip_roll_rad_, 2 * kPi);
}

CatheterTruth ElasticCatheter::truth() const {
  CatheterTruth truth;
  truth.tip = rod_.tip();
  truth.path_m = rod_.lumen().map().start_m(truth.tip.branch) + truth.tip.arc_m;
  truth.tip_model = rod_.shape().points.rightCols<1>();
  truth.direction_model = rod_.shape().edge(rod_.shape().size() - 2).normalized();
  truth.roll_rad = tip_roll_rad_;
  truth.bend_rad = degToRad(settings_.tip_angle_deg) + bend_rad_;
  truth.buckled = bulges_;
  felt_.describe(truth);
  return truth;
}

Eigen::Matrix3Xd ElasticCatheter::line(const Eigen::Matrix3Xd& points) const {
  const Eigen::Index held = 1;  // The first point only gives the direction in which it comes in.
  Eigen::Matrix3Xd line = rod_.shape().points.rightCols(rod_.shape().size() - held);
  if (points == tree_.points()) return line;
  for (Eigen::Index i = 0; i < line.cols(); ++i) {  // As moved tissue takes the vessel beside it along.
    const EdgePoint at = rod_.edgePoint(i + held);
    line.col(i) += (1 - at.weight) * (points.col(at.a) - tree_.points().col(at.a)) +
                   at.weight * (points.col(at.b) - tree_.points().col(at.b));
  }
  return line;
}

}  // namespace angio::simulation

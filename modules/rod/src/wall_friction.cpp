// SPDX-License-Identifier: GPL-2.0-or-later
#include "wall_friction.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace angio::rod {
namespace {

constexpr double kStick_m = 5e-6;  // Way over which friction builds up.

// How far the surface has slid along the wall [m], and by which freedoms: turn of the edge before, place, turn of the
// edge behind.
struct Slide {
  Eigen::Vector3d way_m;
  Eigen::Matrix<double, 3, 5> J;
};

Slide slideOf(const RodShape& shape, const SlidingPoint& s, double radius_m) {
  const Eigen::Index i = s.point;
  const bool end = i + 1 == shape.size();
  const double share = end ? 1.0 : 0.5;
  const Eigen::Vector3d by_turn = share * radius_m * s.along.cross(s.outward);
  Slide slide;
  slide.J.setZero();
  slide.J.col(0) = by_turn;
  slide.J.middleCols<3>(1) = Eigen::Matrix3d::Identity() - s.outward * s.outward.transpose();
  if (!end) slide.J.col(4) = by_turn;
  slide.way_m = slide.J.middleCols<3>(1) * (shape.points.col(i) - s.from) + shape.turned[i - 1] * by_turn;
  if (!end) slide.way_m += shape.turned[i] * by_turn;
  return slide;
}

}  // namespace

double slidingEnergy(const RodShape& shape, const std::vector<SlidingPoint>& points, double radius_m,
                     Eigen::VectorXd* gradient, BandedSystem* hessian) {
  double energy = 0;
  for (const SlidingPoint& s : points) {
    const Slide slide = slideOf(shape, s, radius_m);
    const double root = std::sqrt(slide.way_m.squaredNorm() + kStick_m * kStick_m);
    energy += s.bound_n * (root - kStick_m);
    const Eigen::Index at = RodShape::turnOf(s.point - 1), count = s.point + 1 == shape.size() ? 4 : 5;
    if (gradient) gradient->segment(at, count) += (s.bound_n / root * slide.J.transpose() * slide.way_m).head(count);
    if (!hessian) continue;
    const Eigen::Vector3d way = slide.way_m / root;
    const Eigen::Matrix3d inner = s.bound_n / root * (Eigen::Matrix3d::Identity() - way * way.transpose());
    const Eigen::Matrix<double, 5, 5> block = slide.J.transpose() * inner * slide.J;
    hessian->add(at, block.topLeftCorner(count, count));
  }
  return energy;
}

Eigen::Vector3d friction_n(const RodShape& shape, const SlidingPoint& sliding, double radius_m) {
  const Eigen::Vector3d way_m = slideOf(shape, sliding, radius_m).way_m;
  return -sliding.bound_n / std::sqrt(way_m.squaredNorm() + kStick_m * kStick_m) * way_m;
}

}  // namespace angio::rod

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rod/rod_shape.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "angio/geometry/se3.hpp"

namespace angio::rod {
namespace {

Eigen::Vector3d turnedAbout(const Eigen::Vector3d& v, const Eigen::Vector3d& axis, double angle_rad) {
  return std::cos(angle_rad) * v + std::sin(angle_rad) * axis.cross(v);
}

Eigen::Vector3d normalTo(const Eigen::Vector3d& v, const Eigen::Vector3d& along) {
  return (v - v.dot(along) * along).normalized();
}

// Brings each twist up to date, the turn nearest to what it was.
void updateTwists(RodShape& shape) {
  Eigen::Vector3d before = shape.edge(0).normalized();
  for (Eigen::Index i = 1; i + 1 < shape.size(); ++i) {
    const Eigen::Vector3d along = shape.edge(i).normalized();
    const Eigen::Vector3d untwisted = carried(shape.directors.col(i - 1), before, along), is = shape.directors.col(i);
    const double angle = std::atan2(untwisted.cross(is).dot(along), untwisted.dot(is));
    shape.twists[i] += std::remainder(angle - shape.twists[i], 2 * kPi);
    before = along;
  }
}

}  // namespace

Eigen::Vector3d carried(const Eigen::Vector3d& v, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d axis = from.cross(to);
  const double c = from.dot(to);
  if (c < -0.999999) return v;  // Turned back on itself: no shortest way.
  return c * v + axis.cross(v) + axis.dot(v) / (1 + c) * axis;
}

RodShape untwistedRod(const Eigen::Matrix3Xd& points, const Eigen::Vector3d& across) {
  RodShape shape;
  shape.points = points;
  shape.directors.resize(3, points.cols() - 1);
  shape.twists = Eigen::VectorXd::Zero(points.cols());
  shape.turned = Eigen::VectorXd::Zero(points.cols() - 1);
  Eigen::Vector3d along = shape.edge(0).normalized(), director = normalTo(across, along);
  for (Eigen::Index j = 0; j < shape.directors.cols(); ++j) {
    const Eigen::Vector3d next = shape.edge(j).normalized();
    director = normalTo(carried(director, along, next), next);
    shape.directors.col(j) = director;
    along = next;
  }
  return shape;
}

RodShape moved(const RodShape& shape, const Eigen::VectorXd& step) {
  RodShape next = shape;
  for (Eigen::Index i = 2; i < shape.size(); ++i) next.points.col(i) += step.segment<3>(RodShape::placeOf(i));
  for (Eigen::Index j = 1; j + 1 < shape.size(); ++j) {
    const Eigen::Vector3d along = next.edge(j).normalized();
    const Eigen::Vector3d director =
        normalTo(carried(shape.directors.col(j), shape.edge(j).normalized(), along), along);
    const double turn = step[RodShape::turnOf(j)];
    next.directors.col(j) = turnedAbout(director, along, turn);
    next.turned[j] += turn;
  }
  for (Eigen::Index i = 1; i + 1 < shape.size(); ++i) {
    // Near to what the twist will be: a turn of more than half a round stays one.
    next.twists[i] += step[RodShape::turnOf(i)] - (i > 1 ? step[RodShape::turnOf(i - 1)] : 0.0);
  }
  updateTwists(next);
  return next;
}

RodShape rolled(const RodShape& shape, double angle_rad) {
  RodShape next = shape;
  next.directors.col(0) = turnedAbout(shape.directors.col(0), shape.edge(0).normalized(), angle_rad);
  next.turned[0] += angle_rad;
  next.twists[1] -= angle_rad;
  updateTwists(next);
  return next;
}

}  // namespace angio::rod

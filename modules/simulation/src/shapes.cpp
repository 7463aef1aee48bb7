// SPDX-License-Identifier: GPL-2.0-or-later
#include "shapes.hpp"

#include <algorithm>
#include <cmath>

namespace angio {
namespace {

constexpr double kAlongAxis = 1e-18;  // A ray along a cylinder's axis meets its wall far beyond both ends.

}  // namespace

ShapeInView::ShapeInView(const Shape& shape, const Pose& T_camera_body)
    : kind_(shape.kind),
      M_(shape.half_axes.cwiseInverse().asDiagonal() * (T_camera_body.linear() * shape.axes).transpose()),
      origin_(-M_ * (T_camera_body * shape.centre)),
      centre_(T_camera_body * shape.centre),
      reach_m_(kind_ == Shape::Kind::kEllipsoid
                   ? shape.half_axes.maxCoeff()
                   : std::hypot(shape.half_axes.head<2>().maxCoeff(), shape.half_axes.z())) {}

std::optional<ShapeInView::Span> ShapeInView::meet(double dx, double dy) const {
  const Eigen::Vector3d d = M_.col(0) * dx + M_.col(1) * dy + M_.col(2);
  const int round = kind_ == Shape::Kind::kEllipsoid ? 3 : 2;  // Dimensions of the unit ball.
  double a = 0, b = 0, c = -1;
  for (int i = 0; i < round; ++i) {
    a += d[i] * d[i];
    b += d[i] * origin_[i];
    c += origin_[i] * origin_[i];
  }
  a = std::max(a, kAlongAxis);
  const double h = b * b - a * c;
  if (!(h > 0)) return std::nullopt;
  const double root = std::sqrt(h);
  Span span{(-b - root) / a, (-b + root) / a};
  if (kind_ == Shape::Kind::kCylinder) {
    const double low = (-1 - origin_.z()) / d.z(), high = (1 - origin_.z()) / d.z();  // Infinite along the ends.
    span.in = std::max(span.in, std::min(low, high));
    span.out = std::min(span.out, std::max(low, high));
  }
  span.in = std::max(span.in, 0.0);
  if (!(span.out > span.in)) return std::nullopt;
  return span;
}

}  // namespace angio

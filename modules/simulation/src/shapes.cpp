// SPDX-License-Identifier: GPL-2.0-or-later
#include "shapes.hpp"

#include <cmath>

// Compiled once for every vector target by the include below, which is chosen from at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "shapes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef ANGIO_SHAPES_RAW
#define ANGIO_SHAPES_RAW
namespace angio::simulation {
// A row of rays in units of a shape's half axes, from its centre: ray i is o + t (d + i step).
struct UnitRays {
  double o[3], d[3], step[3];
  int count;
};
constexpr double kAlongAxis = 1e-18;  // A ray along a cylinder's axis meets its wall far beyond both ends.
}  // namespace angio::simulation
#endif

HWY_BEFORE_NAMESPACE();
namespace angio::simulation {
namespace HWY_NAMESPACE {

// The unit ball, or the unit cylinder around z between -1 and 1. No branches: the compiler makes vectors of it.
template <bool kCylinder>
void meetUnit(const UnitRays& rays, double* __restrict in, double* __restrict out) {
  const double ox = rays.o[0], oy = rays.o[1], oz = rays.o[2];
  const double c = ox * ox + oy * oy + (kCylinder ? 0 : oz * oz) - 1;
  for (int i = 0; i < rays.count; ++i) {
    const double x = rays.d[0] + i * rays.step[0], y = rays.d[1] + i * rays.step[1], z = rays.d[2] + i * rays.step[2];
    const double square = x * x + y * y + (kCylinder ? 0 : z * z), b = x * ox + y * oy + (kCylinder ? 0 : z * oz);
    const double a = square > kAlongAxis ? square : kAlongAxis;
    const double h = b * b - a * c;
    const double root = std::sqrt(h > 0 ? h : 0.0);
    double from = (-b - root) / a, to = (-b + root) / a;
    if (kCylinder) {
      const double low = (-1 - oz) / z, high = (1 - oz) / z;  // Infinite along the ends.
      const double near = low < high ? low : high, far = low < high ? high : low;
      from = from > near ? from : near;
      to = to < far ? to : far;
    }
    from = from > 0 ? from : 0.0;
    const bool met = (h > 0) & (to > from);
    in[i] = met ? from : 0.0;
    out[i] = met ? to : 0.0;
  }
}

void meetEllipsoid(const UnitRays& rays, double* in, double* out) { meetUnit<false>(rays, in, out); }
void meetCylinder(const UnitRays& rays, double* in, double* out) { meetUnit<true>(rays, in, out); }

}  // namespace HWY_NAMESPACE
}  // namespace angio::simulation
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace angio::simulation {
namespace {

HWY_EXPORT(meetEllipsoid);
HWY_EXPORT(meetCylinder);

}  // namespace

ShapeInView::ShapeInView(const Shape& shape, const Pose& T_camera_body)
    : kind_(shape.kind),
      M_(shape.half_axes.cwiseInverse().asDiagonal() * (T_camera_body.linear() * shape.axes).transpose()),
      origin_(-M_ * (T_camera_body * shape.center)),
      center_(T_camera_body * shape.center),
      reach_m_(kind_ == Shape::Kind::kEllipsoid
                   ? shape.half_axes.maxCoeff()
                   : std::hypot(shape.half_axes.head<2>().maxCoeff(), shape.half_axes.z())) {}

void ShapeInView::meet(const RayRow& row, double* in, double* out) const {
  const Eigen::Vector3d d = M_.col(0) * row.dx + M_.col(1) * row.dy + M_.col(2), step = M_.col(0) * row.step;
  const UnitRays rays{
      {origin_.x(), origin_.y(), origin_.z()}, {d.x(), d.y(), d.z()}, {step.x(), step.y(), step.z()}, row.count};
  if (kind_ == Shape::Kind::kCylinder) {
    HWY_DYNAMIC_DISPATCH(meetCylinder)(rays, in, out);
  } else {
    HWY_DYNAMIC_DISPATCH(meetEllipsoid)(rays, in, out);
  }
}

}  // namespace angio::simulation
#endif  // HWY_ONCE

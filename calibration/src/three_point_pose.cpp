// SPDX-License-Identifier: GPL-2.0-or-later
#include "three_point_pose.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace angio::calibration {
namespace {

constexpr double kLeastRatio = 0.5, kMostRatio = 2;  // Of the third point's distance to the first's.
constexpr int kRatioSteps = 48;

// Axes on three points, the first along the way from the first to the second.
Eigen::Matrix3d axesOn(const Eigen::Matrix3d& points) {
  Eigen::Matrix3d axes;
  axes.col(0) = (points.col(1) - points.col(0)).normalized();
  axes.col(2) = axes.col(0).cross(points.col(2) - points.col(0)).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

// A polynomial of degree 4, the constant first.
using Quartic = std::array<double, 5>;

double valueOf(const Quartic& c, double v) { return (((c[4] * v + c[3]) * v + c[2]) * v + c[1]) * v + c[0]; }

// The root between two places of different sign, by halving.
double rootBetween(const Quartic& c, double low, double high) {
  const bool rises = valueOf(c, low) < 0;
  for (int i = 0; i < 44; ++i) {
    const double middle = 0.5 * (low + high);
    ((valueOf(c, middle) < 0) == rises ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

void threePointPoses(const Eigen::Matrix3d& points_m, const Eigen::Matrix3d& rays, std::vector<Pose>& poses) {
  poses.clear();
  const double a2 = (points_m.col(1) - points_m.col(2)).squaredNorm();
  const double b2 = (points_m.col(0) - points_m.col(2)).squaredNorm();
  const double c2 = (points_m.col(0) - points_m.col(1)).squaredNorm();
  const double cos_a = rays.col(1).dot(rays.col(2)), cos_b = rays.col(0).dot(rays.col(2)),
               cos_c = rays.col(0).dot(rays.col(1));
  const double less = (a2 - c2) / b2, more = (a2 + c2) / b2, a = a2 / b2, c = c2 / b2;
  const Quartic quartic = {
      (1 + less) * (1 + less) - 4 * a * cos_c * cos_c,
      4 * (-less * (1 + less) * cos_b + 2 * a * cos_c * cos_c * cos_b - (1 - more) * cos_a * cos_c),
      2 * (less * less - 1 + 2 * less * less * cos_b * cos_b + 2 * (1 - c) * cos_a * cos_a -
           4 * more * cos_a * cos_b * cos_c + 2 * (1 - a) * cos_c * cos_c),
      4 * (less * (1 - less) * cos_b - (1 - more) * cos_a * cos_c + 2 * c * cos_a * cos_a * cos_b),
      (less - 1) * (less - 1) - 4 * c * cos_a * cos_a};
  const double step = std::pow(kMostRatio / kLeastRatio, 1.0 / kRatioSteps);
  double low = kLeastRatio, at_low = valueOf(quartic, low);
  for (int i = 0; i < kRatioSteps; ++i) {
    const double high = low * step, at_high = valueOf(quartic, high);
    if ((at_low < 0) != (at_high < 0)) {
      const double v = rootBetween(quartic, low, high);
      const double u = ((less - 1) * v * v - 2 * less * cos_b * v + 1 + less) / (2 * (cos_c - v * cos_a));
      const double first_m = std::sqrt(b2 / (1 + v * v - 2 * v * cos_b));
      if (u > 0 && std::isfinite(first_m)) {
        Eigen::Matrix3d seen_m;
        seen_m << first_m * rays.col(0), u * first_m * rays.col(1), v * first_m * rays.col(2);
        Pose T;
        T.linear() = axesOn(seen_m) * axesOn(points_m).transpose();
        T.translation() = seen_m.col(0) - T.linear() * points_m.col(0);
        poses.push_back(T);
      }
    }
    low = high;
    at_low = at_high;
  }
}

}  // namespace angio::calibration

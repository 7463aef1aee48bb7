// SPDX-License-Identifier: GPL-2.0-or-later
#include "catheter_shape.hpp"

#include <algorithm>
#include <cmath>

namespace angio::simulation {
namespace {

constexpr double kStep_m = 1e-3;
constexpr int kRounds = 30;  // Of smoothing: rounds off what is shorter than about sqrt(30) steps.

}  // namespace

Eigen::Matrix3Xd catheterShape(const TreeTopology& map, const VesselTree& tree, const Eigen::Matrix3Xd& points,
                               const std::vector<int>& path, double tip_m, double radius_m, double tip_length_m,
                               const Eigen::Vector3d& deflected_m) {
  const int steps = std::max(1, static_cast<int>(std::ceil(tip_m / kStep_m)));
  Eigen::Matrix3Xd center(3, steps + 1);
  Eigen::VectorXd lab(steps + 1);
  std::size_t k = 0;
  for (int i = 0; i <= steps; ++i) {
    const double s = tip_m * i / steps;
    while (k + 1 < path.size() && s > map.start_m(path[k + 1])) ++k;
    const EdgePoint at = map.spot({path[k], s - map.start_m(path[k])});
    center.col(i) = (1 - at.weight) * points.col(at.a) + at.weight * points.col(at.b);
    lab[i] = std::max((1 - at.weight) * *tree.radii()[at.a] + at.weight * *tree.radii()[at.b] - radius_m, 0.0);
  }
  const auto heldInside = [&](int i, const Eigen::Vector3d& p) -> Eigen::Vector3d {
    const Eigen::Vector3d off = p - center.col(i);
    const double distance = off.norm();
    return distance > lab[i] ? Eigen::Vector3d(center.col(i) + lab[i] / distance * off) : p;
  };
  Eigen::Matrix3Xd line = center;
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 1; i < steps; ++i) {
      line.col(i) = heldInside(i, 0.25 * line.col(i - 1) + 0.5 * line.col(i) + 0.25 * line.col(i + 1));
    }
  }
  for (int i = 0; i <= steps; ++i) {
    const double from_bend = 1 - (tip_m - tip_m * i / steps) / tip_length_m;
    if (from_bend > 0) line.col(i) = heldInside(i, line.col(i) + from_bend * from_bend * deflected_m);
  }
  return line;
}

}  // namespace angio::simulation

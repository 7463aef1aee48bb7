// SPDX-License-Identifier: GPL-2.0-or-later
#include "fork_plan.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/se3.hpp"

namespace angio::navigation {
namespace {

constexpr int kAngles = 72;
constexpr int kBends = 13;
constexpr double kLevers[] = {0.7, 1.3};  // The distance over which a tip chooses a branch is not well known.
constexpr double kCloser = 0.03;  // [rad] A larger bend must earn its contact with the wall by this for each step.

// Frame of the vessel that ends at the fork in front of `child`.
TreeFrame forkFrame(const TreeTopology& map, int child) {
  const auto parent = map.parent(child);
  return parent ? map.frame({*parent, map.length_m(*parent)}) : map.frame({child, 0});
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0));
}

// How much nearer to the goal the tip points than to any other branch.
double marginOf(const Fork& fork, double angle, double bend) {
  const TreeFrame& f = fork.frame;
  const Eigen::Vector3d tip =
      std::cos(bend) * f.along + std::sin(bend) * (std::cos(angle) * f.normal + std::sin(angle) * f.binormal);
  double nearest = kPi;
  for (const Eigen::Vector3d& other : fork.others) nearest = std::min(nearest, angleBetween(tip, other));
  return nearest - angleBetween(tip, fork.goal);
}

}  // namespace

Fork forkAt(const TreeTopology& map, int wanted, int towards, double lever_m) {
  const auto parent = map.parent(wanted);
  Fork fork{forkFrame(map, wanted), Eigen::Vector3d::UnitZ(), {}};
  fork.goal = fork.frame.along;
  if (!parent) return fork;
  bool leads = false;
  const double parted_m = map.parting_m(*parent) + 0.5 * lever_m;
  for (const TreeRoute& route : map.routesFrom(*parent, std::max(lever_m, parted_m))) {
    if (route.child != wanted) {
      fork.others.push_back(route.direction);
    } else if (!leads) {
      fork.goal = route.direction;
      leads = map.passes(towards, route.last) || map.passes(route.last, towards);
    }
  }
  return fork;
}

Eigen::Vector2d sidewaysOf(const TreeTopology& map, int child, int towards, double lever_m) {
  const Fork fork = forkAt(map, child, towards, lever_m);
  return {fork.goal.dot(fork.frame.normal), fork.goal.dot(fork.frame.binormal)};
}

ForkPlan planForks(const TreeTopology& map, const std::vector<int>& wanted, int target, const TipRange& range,
                   double std_rad, double lever_m) {
  std::vector<Fork> forks;
  for (const int branch : wanted) {
    for (const double part : kLevers) forks.push_back(forkAt(map, branch, target, part * lever_m));
  }
  const auto margin = [&](double angle, double bend) {
    double least = kPi;
    for (const Fork& fork : forks) least = std::min(least, marginOf(fork, angle, bend));
    return least;
  };
  ForkPlan best{0, range.min_bend_rad, -10};
  for (int b = 0; b < kBends; ++b) {
    const double bend = range.min_bend_rad + b * (range.max_bend_rad - range.min_bend_rad) / (kBends - 1);
    for (int a = 0; a < kAngles; ++a) {
      const double angle = 2 * kPi * a / kAngles;
      const double worst =
          std::min({margin(angle, bend), margin(angle - std_rad, bend), margin(angle + std_rad, bend)});
      if (worst - kCloser * b > best.margin_rad) best = {angle, bend, worst - kCloser * b};
    }
  }
  return best;
}

Eigen::Vector2d sideTowards(const Fork& fork) {
  double nearest = kPi;
  Eigen::Vector2d side = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3d& other : fork.others) {
    const double apart = angleBetween(other, fork.goal);
    const Eigen::Vector3d off = fork.goal - other;
    const Eigen::Vector2d across(off.dot(fork.frame.normal), off.dot(fork.frame.binormal));
    if (apart < nearest && across.norm() > 0) nearest = apart, side = across.normalized();
  }
  return side;
}

}  // namespace angio::navigation

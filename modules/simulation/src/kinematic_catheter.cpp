// SPDX-License-Identifier: GPL-2.0-or-later
#include "kinematic_catheter.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

namespace angio::simulation {
namespace {

constexpr double kStep_m = 1e-3;
constexpr int kRounds = 30;  // Of smoothing: rounds off what is shorter than about sqrt(30) steps.

// The line of a catheter, 3 x N [m], tip last, where the tree's points stand at `points`: as straight as the lumen
// lets it be, and its last `tip_length_m` leaning over to `deflected_m` at the end.
//
// @param path  Branches from the root to the tip, which is `tip_m` along them. @param tree  With all radii known.
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

constexpr double kMaxSlide_m = 0.5e-3;  // In one step: what springs forward passes its forks one by one.
constexpr double kRest_m = 1e-9;        // Less than that is no motion.
constexpr double kParted_m = 1e-3;      // Beyond where ways part, they have directions of their own.

}  // namespace

KinematicCatheter::KinematicCatheter(const VesselTree& tree, const CatheterSettings& settings,
                                     const TreeLocation& start)
    : settings_(settings), tree_(tree), map_(tree_), path_(map_.pathTo(start.branch)) {
  tip_m_ = map_.start_m(start.branch) + start.arc_m;
  feel(tip_m_);
}

CatheterTruth KinematicCatheter::truth() const {
  CatheterTruth truth;
  truth.tip = placeAt(tip_m_);
  truth.path_m = tip_m_;
  truth.tip_model = line(tree_.points()).rightCols<1>();
  truth.direction_model = heldDirection();
  truth.roll_rad = roll_rad_ + degToRad(settings_.roll_zero_deg);
  truth.bend_rad = degToRad(settings_.tip_angle_deg) + bend_rad_;
  truth.buckled = buckled_;
  felt_.describe(truth);
  return truth;
}

Eigen::Matrix3Xd KinematicCatheter::line(const Eigen::Matrix3Xd& points) const {
  const double tip_length_m = 1e-3 * settings_.tip_length_mm, lumen = deflection_m(placeAt(tip_m_));
  const TreeFrame frame = map_.frame(placeAt(tip_m_));
  const double roll = roll_rad_ + degToRad(settings_.roll_zero_deg);
  const Eigen::Vector3d sideways = std::cos(roll) * frame.normal + std::sin(roll) * frame.binormal;
  return catheterShape(map_, tree_, points, path_, tip_m_, 0.5e-3 * settings_.diameter_mm, tip_length_m,
                       lumen * sideways);
}

bool KinematicCatheter::settle(const Base& base) {
  const double bends = std::exp(settings_.friction * map_.turned_rad(placeAt(tip_m_)));
  const double wind_up = degToRad(settings_.wind_up_deg_per_m) * tip_m_ * bends;
  roll_rad_ = followed(roll_rad_, base[1], 0.5 * degToRad(settings_.roll_backlash_deg) + wind_up);
  bend_rad_ = followed(bend_rad_, base[2], 0.5 * degToRad(settings_.bend_backlash_deg));
  const double before_m = tip_m_;
  slide(base[0]);
  // A shaft that slides has its friction along itself and none about itself: what was wound up comes out at the tip.
  const double let_out = 1 - std::exp(-std::abs(tip_m_ - before_m) / (1e-3 * settings_.unwind_mm));
  const double lag = base[1] - roll_rad_, play = 0.5 * degToRad(settings_.roll_backlash_deg);
  roll_rad_ += let_out * (lag - std::clamp(lag, -play, play));
  feel(base[0]);
  return std::abs(tip_m_ - before_m) >= kRest_m;
}

double KinematicCatheter::freePlay() const {
  return 0.5e-3 * settings_.insertion_backlash_mm +
         1e-3 * settings_.slack_mm_per_rad * map_.turned_rad(placeAt(tip_m_));
}

double KinematicCatheter::slidingForce() const {
  return settings_.drag_n_per_m * tip_m_ * std::exp(settings_.friction * map_.turned_rad(placeAt(tip_m_)));
}

void KinematicCatheter::slide(double insertion_m) {
  const double pushed = insertion_m - tip_m_;
  const double held = freePlay() + slidingForce() / settings_.stiffness_n_per_m;
  blocked_ = false;
  if (pushed > held + kRest_m) {
    const bool buckles = slidingForce() >= settings_.buckling_force_n;
    blocked_ = buckles || !advanceTip(std::min(pushed - held, kMaxSlide_m));
  } else if (pushed < -held - kRest_m) {
    retractTip(std::min(-pushed - held, kMaxSlide_m));
  }
}

bool KinematicCatheter::advanceTip(double step_m) {
  const int branch = path_.back();
  const double left_m = map_.start_m(branch) + map_.length_m(branch) - tip_m_;
  if (step_m < left_m) {
    const TreeLocation ahead = placeAt(tip_m_ + step_m);
    if (radius(ahead) < 0.5e-3 * settings_.diameter_mm) return false;
    tip_m_ += step_m;
    return true;
  }
  if (map_.children(branch).empty()) return false;
  double beside = 0;
  const int child = choose(branch, &beside);
  if (beside > degToRad(settings_.cone_deg)) return false;
  path_.push_back(child);
  tip_m_ += left_m;
  return true;
}

void KinematicCatheter::retractTip(double step_m) {
  tip_m_ = std::max(tip_m_ - step_m, 0.0);
  while (path_.size() > 1 && tip_m_ < map_.start_m(path_.back())) path_.pop_back();
}

// The child through which that way leads whose lumen the free tip points least beside, and how far beside. The tip
// decides where the ways part, before which all of them are one lumen, and by where they have got to along its own
// length: it is too stiff for what turns back and forth in less.
int KinematicCatheter::choose(int branch, double* worst) const {
  const Eigen::Vector3d tip = freeDirection();
  const double lever_m = std::max(1e-3 * settings_.tip_length_mm, map_.parting_m(branch) + kParted_m);
  int best = map_.children(branch).front();
  double least = 1e9;
  for (const TreeRoute& route : map_.routesFrom(branch, lever_m)) {
    const double angle = std::acos(std::clamp(tip.dot(route.direction), -1.0, 1.0));
    const double lumen = std::atan2(route.radius_m, lever_m);
    if (angle - lumen < least) least = angle - lumen, best = route.child;
  }
  *worst = least;
  return best;
}

void KinematicCatheter::feel(double insertion_m) {
  const double pushed = insertion_m - tip_m_, taut = std::max(std::abs(pushed) - freePlay(), 0.0);
  const double wanted = settings_.stiffness_n_per_m * taut;
  buckled_ = blocked_ && wanted > settings_.buckling_force_n;
  force_n_ = std::copysign(std::min(wanted, settings_.buckling_force_n), pushed);
  const Eigen::Vector3d free = freeDirection(), held = heldDirection();
  tip_force_n_ = settings_.tip_stiffness_n_per_rad * std::acos(std::clamp(free.dot(held), -1.0, 1.0));
  if (blocked_) {
    const double lost = std::exp(-settings_.friction * map_.turned_rad(placeAt(tip_m_)));
    tip_force_n_ += std::max(force_n_ - slidingForce(), 0.0) * lost;
  }
  felt_.feel(tip_force_n_, force_n_);
}

double KinematicCatheter::radius(const TreeLocation& place) const {
  const EdgePoint at = map_.spot(place);
  return (1 - at.weight) * *tree_.radii()[at.a] + at.weight * *tree_.radii()[at.b];
}

TreeLocation KinematicCatheter::placeAt(double path_m) const {
  auto branch = path_.rbegin();
  while (branch + 1 != path_.rend() && path_m < map_.start_m(*branch)) ++branch;
  return {*branch, path_m - map_.start_m(*branch)};
}

// How far the tip's end stands beside the centreline [m]: as its bend has it, or as far as the lumen lets it.
double KinematicCatheter::deflection_m(const TreeLocation& place) const {
  const double bend = std::min(degToRad(settings_.tip_angle_deg) + bend_rad_, 0.5 * kPi);
  return std::min(1e-3 * settings_.tip_length_mm * std::sin(bend),
                  std::max(radius(place) - 0.5e-3 * settings_.diameter_mm, 0.0));
}

Eigen::Vector3d KinematicCatheter::freeDirection() const {
  const TreeFrame frame = map_.frame(placeAt(tip_m_));
  const double bend = degToRad(settings_.tip_angle_deg) + bend_rad_;
  const double roll = roll_rad_ + degToRad(settings_.roll_zero_deg);
  return std::cos(bend) * frame.along +
         std::sin(bend) * (std::cos(roll) * frame.normal + std::sin(roll) * frame.binormal);
}

Eigen::Vector3d KinematicCatheter::heldDirection() const {
  const TreeLocation tip = placeAt(tip_m_);
  const TreeFrame frame = map_.frame(tip);
  const double roll = roll_rad_ + degToRad(settings_.roll_zero_deg);
  // The deflection grows as the square of the way from the bend: at its end it rises twice as steeply as on average.
  const double slope = 2 * deflection_m(tip) / (1e-3 * settings_.tip_length_mm);
  return (frame.along + slope * (std::cos(roll) * frame.normal + std::sin(roll) * frame.binormal)).normalized();
}

}  // namespace angio::simulation

// SPDX-License-Identifier: GPL-2.0-or-later
#include "joint_trajectory_mpc.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace angio::servo {
namespace {

constexpr int kMaxPoints = JointPaths::kMaxPoints;
constexpr int kMaxSweeps = 30;
constexpr double kSettled = 1e-3;  // Of the largest change: what a sweep that moves less is not worth.

using Changes = Eigen::Matrix<double, kMaxPoints, 1>;
using Hessian = Eigen::Matrix<double, kMaxPoints, kMaxPoints>;

// How one joint moves, and what it can: changes are of its velocity from one period to the next.
struct JointMotion {
  double velocity;         // Now.
  double last_change;      // How it came about.
  double max_change;       // Acceleration times period.
  double max_change_step;  // Between one change and the next: jerk times the period's square.
};

// What changes of velocity c_1 ... c_n cost, the same for all joints: c . H c / 2 - c . g.
struct Cost {
  Cost(const JointPaths& paths, double effort) {
    const int n = paths.size();
    H.setZero();
    for (int i = 0; i < n; ++i) {
      H(i, i) = effort;
      for (int k = i; k < n; ++k) {
        const double share = paths.weight(k) * (k - i + 1);
        for (int j = 0; j <= k; ++j) H(i, j) += share * (k - j + 1);
      }
    }
    along.setZero();
    for (int i = 0; i < n; ++i) along.col(i) = H.middleCols(i, n - i).rowwise().sum();
  }
  Hessian H, along;  // along.col(i) = the sum of H's columns from i on.
};

// The changes of velocity c_1 ... c_n of a plan, all within their bounds from the first one on.
class Plan {
 public:
  // Borrows the cost.
  Plan(const JointPaths& paths, int which, const JointMotion& joint, const Cost& cost, double period_s)
      : n_(paths.size()), joint_(joint), H_(cost.H), along_(cost.along) {
    joint_.last_change = std::clamp(joint.last_change, -joint.max_change, joint.max_change);
    // place_k = period (k v + sum over i <= k of (k - i + 1) c_i).
    left_.setZero();
    for (int i = 0; i < n_; ++i) {
      for (int k = i; k < n_; ++k) {
        const double share = paths.weight(k) * (k - i + 1);
        left_[i] += share * (paths.place(which, k) / period_s - (k + 1) * joint.velocity);
      }
    }
    // What changed goes out as fast as it may.
    Changes out = Changes::Zero();
    double change = joint_.last_change;
    for (int i = 0; i < n_; ++i) {
      change -= std::clamp(change, -joint_.max_change_step, joint_.max_change_step);
      out[i] = change;
    }
    changes_ = out;
    left_ -= H_ * out;
  }

  double first() {
    for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
      double moved = 0;
      for (int i = 0; i < n_; ++i) moved = std::max({moved, changeFrom(i), changeOne(i)});
      if (moved <= kSettled * joint_.max_change) break;
    }
    return changes_[0];
  }

 private:
  double before(int i) const { return i > 0 ? changes_[i - 1] : joint_.last_change; }

  // One change alone.
  double changeOne(int i) {
    double low = std::max(-joint_.max_change, before(i) - joint_.max_change_step);
    double high = std::min(joint_.max_change, before(i) + joint_.max_change_step);
    if (i + 1 < n_) {
      low = std::max(low, changes_[i + 1] - joint_.max_change_step);
      high = std::min(high, changes_[i + 1] + joint_.max_change_step);
    }
    const double step = stepWithin(left_[i], H_(i, i), low - changes_[i], high - changes_[i]);
    changes_[i] += step;
    left_ -= step * H_.col(i);
    return std::abs(step);
  }

  // All changes from one on, by as much.
  double changeFrom(int i) {
    const double change_step = changes_[i] - before(i);
    double low = -joint_.max_change_step - change_step, high = joint_.max_change_step - change_step, gain = 0, cost = 0;
    for (int k = i; k < n_; ++k) {
      low = std::max(low, -joint_.max_change - changes_[k]);
      high = std::min(high, joint_.max_change - changes_[k]);
      gain += left_[k];
      cost += along_(k, i);
    }
    const double step = stepWithin(gain, cost, low, high);
    for (int k = i; k < n_; ++k) changes_[k] += step;
    left_ -= step * along_.col(i);
    return std::abs(step);
  }

  // Rounding may leave bounds that cross: then there is no room.
  static double stepWithin(double gain, double cost, double low, double high) {
    if (!(low <= high) || !(cost > 0)) return 0;
    return std::clamp(gain / cost, low, high);
  }

  int n_;
  JointMotion joint_;
  const Hessian &H_, &along_;
  Changes changes_;
  Changes left_;  // g - H c: the descent that is left.
};

// The highest speed from which a joint that comes closer by `left` a period at most stands there: v delay + v^2 / 2a =
// left, with half the time that the acceleration takes to come, and a period, for the delay. All in motions of a
// period.
double brakable(double left, const JointMotion& joint) {
  const double a = joint.max_change, delay = 0.5 * a / joint.max_change_step + 1;
  return std::sqrt(a * a * delay * delay + 2 * a * left) - a * delay;
}

double velocityOfJoint(const JointPaths& paths, int which, const JointMotion& joint, const Cost& cost,
                       double period_s) {
  const double velocity = joint.velocity + Plan(paths, which, joint, cost, period_s).first();
  const double along = paths.size() > 1 ? (paths.place(which, 1) - paths.place(which, 0)) / period_s : 0;
  const double left = paths.place(which, 0) - along * period_s, nearing = velocity - along;
  // What a joint at rest gets to, and stands there, within the horizon is the plan's.
  const double near = joint.max_change * paths.size() * paths.size() / 8;
  if (!(nearing * left > 0) || !(std::abs(left) > near * period_s)) return velocity;
  return along + std::copysign(std::min(std::abs(nearing), brakable(std::abs(left) / period_s, joint)), left);
}

}  // namespace

void JointPaths::add(const CArmJoints& places, double weight) {
  if (size_ == kMaxPoints) return;
  places_[static_cast<std::size_t>(size_)] = places;
  weights_[static_cast<std::size_t>(size_++)] = weight;
}

CArmJoints followingVelocity(const JointPaths& paths, const JointsMotion& motion, const CArmLimits& limits,
                             const PathPlanSettings& settings, double period_s) {
  CArmJoints result = CArmJoints::Zero();
  if (paths.size() == 0) return result;
  const double change = settings.acceleration_share * period_s, change_step = change * period_s;
  const Cost cost(paths, settings.effort);
  for (int i = 0; i < kCArmJointCount; ++i) {
    const JointMotion joint{motion.velocity[i], motion.last_change[i], change * limits.acceleration[i],
                            change_step * limits.jerk[i]};
    result[i] = velocityOfJoint(paths, i, joint, cost, period_s);
  }
  return result;
}

}  // namespace angio::servo

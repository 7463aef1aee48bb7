// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/carm_motion_limiter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "angio/base/errors.hpp"
#include "angio/robot/motion_time.hpp"
#include "angio/robot/nearest_in_polytope.hpp"

namespace angio::robot {
namespace {

constexpr double kMinStep_s = 0.02;  // Of plans: a fast caller's are not made of thousands of steps.
constexpr double kMaxStep_s = 0.1;   // After frames that were missing: the next will come in time.
constexpr int kMaxPlanSteps = 400;
constexpr double kRemembered_s = 2;
constexpr double kRounding = 1e-9;  // Of positions [rad, m].
constexpr double kReserve = 1e-4;  // To a face [rad, m]: what watching ramps at quarters may overlook, five times over.
constexpr int kHalvings = 12;      // A 4000th of a speed is nothing.
constexpr int kMaxEasings = 4;     // Towards room enough to slide.

// The highest rate at which `left` is used up without using more, when each step of dt_s may take fall * dt_s off the
// rate: the highest acceleration from which a joint comes to a speed, by its jerk.
//
// In units of fall dt and fall dt^2: from rate v it takes n = ceil(v) steps, v + (v - 1) + ... = n v - n (n - 1) / 2
// long. The continuous sqrt(2 fall left) alone would step over the end.
double fallingRate(double left, double fall, double dt_s) {
  if (left <= 0 || fall <= 0) return 0;
  const double d = left / (fall * dt_s * dt_s);
  const double n = std::max(1.0, std::ceil(0.5 * (std::sqrt(1 + 8 * d) - 1)));
  const double in_steps = fall * dt_s * (d / n + 0.5 * (n - 1));
  return std::min(std::sqrt(2 * fall * left), in_steps);  // In this order: steps too short to count give NaN.
}

// The velocity after `time_s` of a joint that follows a command with its acceleration.
double velocityAfter(double start, double commanded, double acceleration, double time_s) {
  const double change = commanded - start, most = acceleration * time_s;
  return start + std::clamp(change, -most, most);
}

// How far it gets in that time.
double distanceAfter(double start, double commanded, double acceleration, double time_s) {
  const double change = commanded - start;
  const double ramp_s = std::min(time_s, std::abs(change) / acceleration);
  const double reached = velocityAfter(start, commanded, acceleration, ramp_s);
  return 0.5 * (start + reached) * ramp_s + reached * (time_s - ramp_s);
}

// One step of dt_s from velocity `u` and acceleration `a0` towards velocity `goal`, within acceleration and jerk, such
// that it comes to the goal without shooting over.
double stepTowards(double u, double a0, double goal, double acceleration, double jerk, double dt_s) {
  const double left = goal - u;
  const double a = std::copysign(std::min(acceleration, fallingRate(std::abs(left), jerk, dt_s)), left);
  const double within_jerk = std::clamp(a, a0 - jerk * dt_s, a0 + jerk * dt_s);
  return u + std::clamp(within_jerk, -acceleration, acceleration) * dt_s;
}

// How much further than now normal . joints gets at most if the arm, which moves at `velocity`, brakes, each joint with
// its own acceleration: one that was on its way out may stop later than one that was on its way in. Never negative.
//
// While braking, normal . distance is a sum of parabolas that end one after the other: its highest point lies at an
// end, or where its slope crosses zero in between.
double furthest(const CArmJoints& normal, const CArmJoints& velocity, const CArmJoints& acceleration) {
  std::array<double, kCArmJointCount + 1> ends_s{};  // The first is 0.
  for (int i = 0; i < kCArmJointCount; ++i) {
    ends_s[static_cast<std::size_t>(i) + 1] = normal[i] == 0 ? 0 : std::abs(velocity[i]) / acceleration[i];
  }
  std::sort(ends_s.begin(), ends_s.end());
  const auto slopeAt = [&](double t) {
    double slope = 0;
    for (int i = 0; i < kCArmJointCount; ++i) {
      slope += normal[i] * std::copysign(std::max(0.0, std::abs(velocity[i]) - acceleration[i] * t), velocity[i]);
    }
    return slope;
  };
  double distance = 0, most = 0, slope = slopeAt(0);
  for (std::size_t k = 1; k < ends_s.size(); ++k) {
    const double lasts_s = ends_s[k] - ends_s[k - 1];
    if (lasts_s <= 0) continue;
    const double next = slopeAt(ends_s[k]);
    if (slope > 0 && next < 0) most = std::max(most, distance + 0.5 * slope * slope * lasts_s / (slope - next));
    distance += 0.5 * (slope + next) * lasts_s;
    most = std::max(most, distance);
    slope = next;
  }
  return most;
}

void check(const CArmLimits& limits, double command_validity_s) {
  checkJoints(limits);
  for (int i = 0; i < kCArmJointCount; ++i) {
    requirePositive("c-arm limits", "jerk[" + std::to_string(i) + "]", limits.jerk[i]);
  }
  for (const CArmEnvelope::Face& face : limits.envelope.faces) {
    requireFinite("c-arm envelope", face.name, face.bound);
    for (const double x : face.normal) requireFinite("c-arm envelope", face.name, x);
    requirePositive("c-arm envelope", face.name + ": length of the normal", face.normal.norm());
  }
  const int most = CArmMotionLimiter::kMaxFaces;
  if (static_cast<int>(limits.envelope.faces.size()) > most) {
    throw InputError("c-arm envelope", "faces", std::to_string(limits.envelope.faces.size()),
                     "must be " + std::to_string(most) + " at most");
  }
  requirePositive("c-arm", "command_validity_s", command_validity_s);
}

}  // namespace

CArmMotionLimiter::CArmMotionLimiter(const CArmLimits& limits, double command_validity_s)
    : limits_(limits), command_validity_s_(command_validity_s) {
  check(limits_, command_validity_s_);
  for (CArmEnvelope::Face& face : limits_.envelope.faces) {
    face.bound /= face.normal.norm();
    face.normal.normalize();
  }
}

CArmJoints CArmMotionLimiter::propose(const CArmJoints& wanted, const CArmJoints& measured, double age_s,
                                      double period_s) {
  const bool sound = wanted.allFinite() && measured.allFinite() && std::isfinite(age_s) && age_s >= 0 &&
                     std::isfinite(period_s) && period_s > 0;
  if (!sound) {
    pass(std::isfinite(period_s) ? period_s : 0);
    return CArmJoints::Zero();
  }
  advance(period_s);
  const CArmJoints joints = predicted(measured, age_s);
  const double dt_s = std::min({period_s, command_validity_s_, kMaxStep_s});
  const CArmJoints slow_enough = withinSpeed(wanted, limits_);
  CArmJoints aim, low, high, braking;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const auto towards = [&](double goal) {
      const double v =
          stepTowards(velocity_[i], acceleration_[i], goal, limits_.acceleration[i], limits_.jerk[i], dt_s);
      // After a step that was shorter than planned speed comes before jerk.
      return std::clamp(v, -limits_.velocity[i], limits_.velocity[i]);
    };
    aim[i] = towards(slow_enough[i]);
    low[i] = towards(-limits_.velocity[i]);
    high[i] = towards(limits_.velocity[i]);
    braking[i] = std::clamp(towards(0), low[i], high[i]);
  }
  keepToRange(joints, braking, dt_s, low, high);
  FaceVector eased = FaceVector::Zero(static_cast<Eigen::Index>(limits_.envelope.faces.size()));
  CArmJoints command = braking;
  FaceVector missing = eased;
  for (int k = 0; k < kMaxEasings; ++k) {
    command = slid(joints, aim.cwiseMax(low).cwiseMin(high), low, high, braking, eased);
    missing = missingModule(joints, command, dt_s);
    if ((missing.array() <= 0).all()) return command;
    eased += missing.cwiseMax(0) / command_validity_s_;
  }
  // What was certified a step ago may miss by the rounding of a time.
  if ((missingModule(joints, braking, dt_s).array() > 0.5 * kReserve).any()) return CArmJoints::Zero();
  CArmJoints good = braking;
  for (int k = 0; k < kHalvings; ++k) {
    const CArmJoints middle = 0.5 * (good + command);
    ((missingModule(joints, middle, dt_s).array() <= 0).all() ? good : command) = middle;
  }
  return good;
}

void CArmMotionLimiter::pass(double period_s) {
  if (period_s > 0) advance(period_s);
}

CArmJoints CArmMotionLimiter::limit(const CArmJoints& wanted, const CArmJoints& joints, double age_s, double period_s) {
  commit(propose(wanted, joints, age_s, period_s));
  return command_;
}

CArmJoints CArmMotionLimiter::rest(double period_s) {
  pass(period_s);
  commit(CArmJoints::Zero());
  return command_;
}

void CArmMotionLimiter::advance(double period_s) {
  const CArmJoints before = velocity_;
  const double obeyed_s = std::min(period_s, command_validity_s_);
  remember(obeyed_s, command_);
  if (period_s > obeyed_s) remember(std::min(period_s - obeyed_s, kRemembered_s), CArmJoints::Zero());
  acceleration_ = (velocity_ - before) / period_s;
  double known_s = 0;
  for (const Piece& piece : past_) known_s += piece.duration_s;
  while (past_.size() > 1 && known_s - past_.front().duration_s > kRemembered_s) {
    known_s -= past_.front().duration_s;
    past_.pop_front();
  }
}

void CArmMotionLimiter::remember(double duration_s, const CArmJoints& commanded) {
  past_.push_back({duration_s, velocity_, commanded});
  for (int i = 0; i < kCArmJointCount; ++i) {
    velocity_[i] = velocityAfter(velocity_[i], commanded[i], limits_.acceleration[i], duration_s);
  }
}

CArmJoints CArmMotionLimiter::predicted(const CArmJoints& joints, double age_s) const {
  CArmJoints now = joints;
  for (auto piece = past_.rbegin(); piece != past_.rend() && age_s > 0; ++piece) {
    const double from_s = std::max(0.0, piece->duration_s - age_s);
    for (int i = 0; i < kCArmJointCount; ++i) {
      const auto distance = [&](double t) {
        return distanceAfter(piece->start[i], piece->commanded[i], limits_.acceleration[i], t);
      };
      now[i] += distance(piece->duration_s) - distance(from_s);
    }
    age_s -= piece->duration_s;
  }
  return now;
}

bool CArmMotionLimiter::stopsInside(int i, double q, double command, double lower, double upper, double dt_s) const {
  double u = velocity_[i], a = acceleration_[i], step_s = dt_s;
  for (int k = 0; k < kMaxPlanSteps; ++k) {
    q += distanceAfter(u, command, limits_.acceleration[i], step_s);
    if (q > upper + kRounding || q < lower - kRounding) return false;
    a = (command - u) / step_s;
    u = command;
    if (u == 0 && a == 0) return true;
    step_s = std::max(dt_s, kMinStep_s);
    command = stepTowards(u, a, 0, limits_.acceleration[i], limits_.jerk[i], step_s);
    if (std::abs(command) < kRounding) command = 0;
  }
  return true;
}

void CArmMotionLimiter::keepToRange(const CArmJoints& joints, const CArmJoints& braking, double dt_s, CArmJoints& low,
                                    CArmJoints& high) const {
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double lower = std::min(limits_.lower[i], joints[i]), upper = std::max(limits_.upper[i], joints[i]);
    for (double* end : {&low[i], &high[i]}) {
      if (stopsInside(i, joints[i], *end, lower, upper, dt_s)) continue;
      double good = braking[i];
      for (int k = 0; k < kHalvings; ++k) {
        const double middle = 0.5 * (good + *end);
        (stopsInside(i, joints[i], middle, lower, upper, dt_s) ? good : *end) = middle;
      }
      *end = good;
    }
  }
}

CArmJoints CArmMotionLimiter::slid(const CArmJoints& joints, const CArmJoints& aim, const CArmJoints& low,
                                   const CArmJoints& high, const CArmJoints& braking, const FaceVector& eased) const {
  Polytope allowed;
  const int faces = static_cast<int>(limits_.envelope.faces.size()), rows = faces + 2 * kCArmJointCount;
  allowed.normals.setZero(rows, kCArmJointCount);
  allowed.bounds.resize(rows);
  // In units of the joints' speeds, so that radians and metres count alike.
  const CArmJoints& unit = limits_.velocity;
  for (int i = 0; i < kCArmJointCount; ++i) {
    allowed.normals(2 * i, i) = 1;
    allowed.bounds[2 * i] = high[i] / unit[i];
    allowed.normals(2 * i + 1, i) = -1;
    allowed.bounds[2 * i + 1] = -low[i] / unit[i];
  }
  for (int k = 0; k < faces; ++k) {
    const CArmEnvelope::Face& face = limits_.envelope.faces[static_cast<std::size_t>(k)];
    double slowest = std::numeric_limits<double>::infinity();  // Of the decelerations that a joint adds.
    for (int i = 0; i < kCArmJointCount; ++i) {
      if (face.normal[i] != 0) slowest = std::min(slowest, std::abs(face.normal[i]) * limits_.acceleration[i]);
    }
    // v validity + v^2 / 2a = room.
    const double v = slowest * command_validity_s_, room = std::max(0.0, face.room(joints) - kReserve);
    const double speed = std::sqrt(v * v + 2 * slowest * room) - v;
    const int row = 2 * kCArmJointCount + k;
    const double length = face.normal.cwiseProduct(unit).norm();
    allowed.normals.row(row) = face.normal.cwiseProduct(unit).transpose() / length;
    allowed.bounds[row] = std::max(speed - eased[k], face.normal.dot(braking)) / length;  // Braking is always allowed.
  }
  return nearestInPolytope(aim.cwiseQuotient(unit), allowed, braking.cwiseQuotient(unit)).cwiseProduct(unit);
}

// Silence may come at any time: the arm keeps the command for its validity, and brakes then; a command that stands
// still may come sooner. The joints' ramps are watched at quarters of a step: where one is still on its way out and
// another no longer on its way in, the furthest point lies in between.
CArmMotionLimiter::FaceVector CArmMotionLimiter::missingModule(const CArmJoints& joints, const CArmJoints& first,
                                                               double dt_s) const {
  const auto faces = static_cast<Eigen::Index>(limits_.envelope.faces.size());
  FaceVector missing = FaceVector::Constant(faces, -std::numeric_limits<double>::infinity());
  // Faces that the arm cannot get to before it stands are most of them, most of the time.
  // While its acceleration is taken back a joint gains a^2 / 2j.
  const CArmJoints gain = limits_.acceleration.cwiseAbs2().cwiseQuotient(2 * limits_.jerk);
  const CArmJoints speed = velocity_.cwiseAbs().cwiseMax(first.cwiseAbs()) + gain;
  const CArmJoints max_s = speed.cwiseQuotient(limits_.acceleration) +
                           limits_.acceleration.cwiseQuotient(limits_.jerk) +
                           CArmJoints::Constant(command_validity_s_ + dt_s);
  std::array<Eigen::Index, kMaxFaces> near;
  std::size_t near_count = 0;
  for (Eigen::Index f = 0; f < faces; ++f) {
    const CArmEnvelope::Face& face = limits_.envelope.faces[static_cast<std::size_t>(f)];
    const double distance = face.normal.cwiseAbs().dot(speed.cwiseProduct(max_s));
    if (!(face.room(joints) > distance + kReserve)) near[near_count++] = f;
  }
  CArmJoints q = joints, u = velocity_, command = first;
  double step_s = dt_s;
  for (int k = 0; k < kMaxPlanSteps && near_count > 0; ++k) {
    const auto stopped = [&](double after_s) {
      CArmJoints position = q, velocity;
      for (int i = 0; i < kCArmJointCount; ++i) {
        position[i] += distanceAfter(u[i], command[i], limits_.acceleration[i], after_s);
        velocity[i] = velocityAfter(u[i], command[i], limits_.acceleration[i], after_s);
      }
      for (std::size_t n = 0; n < near_count; ++n) {
        const Eigen::Index f = near[n];
        const CArmEnvelope::Face& face = limits_.envelope.faces[static_cast<std::size_t>(f)];
        // From outside a face: no further out than now.
        const double bound = std::max(face.bound - kReserve, face.normal.dot(joints) + kRounding);
        const double out = face.normal.dot(position) + furthest(face.normal, velocity, limits_.acceleration);
        missing[f] = std::max(missing[f], out - bound);
      }
      return position;
    };
    for (const double part : {0.25, 0.5, 0.75}) stopped(part * step_s);
    stopped(std::max(step_s, command_validity_s_));
    q = stopped(step_s);
    if (command.isZero(0)) return missing;
    for (int i = 0; i < kCArmJointCount; ++i) {
      const double a = (command[i] - u[i]) / step_s;
      u[i] = command[i];
      command[i] = stepTowards(u[i], a, 0, limits_.acceleration[i], limits_.jerk[i], std::max(dt_s, kMinStep_s));
      if (std::abs(command[i]) < kRounding) command[i] = 0;
    }
    step_s = std::max(dt_s, kMinStep_s);
  }
  return missing;
}

}  // namespace angio::robot

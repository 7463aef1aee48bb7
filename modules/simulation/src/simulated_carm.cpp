// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/simulation/simulated_carm.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/base/errors.hpp"

namespace angio::simulation {
namespace {

struct Joint {
  double position, velocity;
};

Joint mirrored(const Joint& joint) { return {-joint.position, -joint.velocity}; }

// Constant acceleration for a time.
Joint after(const Joint& joint, double acceleration, double time_s) {
  return {joint.position + (joint.velocity + 0.5 * acceleration * time_s) * time_s,
          joint.velocity + acceleration * time_s};
}

// The next piece of constant acceleration of a joint that moves up or is about to: where it ends. What the piece takes
// is taken off `time_s`. `room` is what would be left of the range if the joint braked now.
Joint movedUp(const Joint& joint, double wanted, double upper, double a, double& time_s) {
  const auto piece = [&](double acceleration, double max_s) {
    const double taken_s = std::min(time_s, max_s);
    time_s -= taken_s;
    return after(joint, acceleration, taken_s);
  };
  const auto reached = [&](double acceleration, double max_s, double velocity_then) {
    const bool all = max_s <= time_s;
    Joint result = piece(acceleration, max_s);
    if (all) result.velocity = velocity_then;
    return result;
  };
  const double v = joint.velocity, least = std::max(wanted, 0.0);
  const double lab = upper - joint.position - v * v / (2 * a);
  const double close = 1e-12 * (1 + std::abs(upper));  // Rounding of positions must not read as room.
  if (v > least) return reached(-a, (v - least) / a, least);
  if (lab <= close) {
    if (v > 0) return reached(-a, v / a, 0.0);
    time_s = 0;  // Stands at the end of its range and wants beyond it.
    return {upper, 0.0};
  }
  if (v < wanted) {
    // position + v^2 / 2a reaches `upper` where a t^2 + 2 v t = room.
    const double until_brake_s = lab / (v + std::sqrt(v * v + a * lab));
    const double until_wanted_s = (wanted - v) / a;
    if (until_brake_s < until_wanted_s) return piece(a, until_brake_s);
    return reached(a, until_wanted_s, wanted);
  }
  return piece(0, v > 0 ? lab / v : time_s);
}

Joint moved(Joint joint, double wanted, double lower, double upper, double a, double time_s) {
  while (time_s > 0) {
    const bool up = joint.velocity > 0 || (joint.velocity == 0 && wanted >= 0);
    joint =
        up ? movedUp(joint, wanted, upper, a, time_s) : mirrored(movedUp(mirrored(joint), -wanted, -lower, a, time_s));
  }
  // What rounding may leave beyond the end of the range.
  joint.position = std::clamp(joint.position, lower, upper);
  return joint;
}

void check(const CArmLimits& limits, const CArmJoints& start) {
  const char* const names[kCArmJointCount] = {"primary", "secondary", "table_x", "table_y", "table_z"};
  for (int i = 0; i < kCArmJointCount; ++i) {
    const std::string name = names[i];
    requireFinite("c-arm limits", name + ".lower", limits.lower[i]);
    requireFinite("c-arm limits", name + ".upper", limits.upper[i]);
    requirePositive("c-arm limits", name + ".velocity", limits.velocity[i]);
    requirePositive("c-arm limits", name + ".acceleration", limits.acceleration[i]);
    if (limits.lower[i] > limits.upper[i]) {
      throw InputError("c-arm limits", name + ".lower", formatValue(limits.lower[i]),
                       "must not exceed the upper limit");
    }
    requireBetween("c-arm start", name, start[i], limits.lower[i], limits.upper[i]);
  }
}

}  // namespace

SimulatedCArm::SimulatedCArm(const CArmLimits& limits, const CArmJoints& start, std::int64_t now_us,
                             const ReceiverSettings& receiver)
    : CommandReceiver(receiver), limits_(limits) {
  check(limits, start);
  state_.time_us = now_us;
  state_.joints = start;
}

void SimulatedCArm::obey(const CArmCommand& command, std::int64_t now_us, const std::string& sender) {
  advance(now_us);
  if (!takes(command, command.velocity.cwiseQuotient(limits_.velocity), state_.time_us, sender)) return;
  wanted_ = command.velocity.cwiseMax(-limits_.velocity).cwiseMin(limits_.velocity);
  valid_left_us_ = static_cast<std::uint64_t>(std::clamp<std::int64_t>(command.valid_for_us, 0, kMaxValidity_us));
  in_force_ = true;
}

void SimulatedCArm::advance(std::int64_t now_us) {
  if (now_us <= state_.time_us) return;
  // Unsigned: the difference of two signed times may not fit a signed number.
  const std::uint64_t passed_us = static_cast<std::uint64_t>(now_us) - static_cast<std::uint64_t>(state_.time_us);
  const std::uint64_t obeyed_us = std::min(passed_us, valid_left_us_);
  move(static_cast<double>(obeyed_us) * 1e-6, wanted_);
  move(static_cast<double>(passed_us - obeyed_us) * 1e-6, CArmJoints::Zero());
  if (in_force_ && passed_us > valid_left_us_) {
    in_force_ = false;
    ++ran_out_;
  }
  valid_left_us_ -= obeyed_us;
  state_.time_us = now_us;
}

void SimulatedCArm::move(double duration_s, const CArmJoints& wanted_velocity) {
  for (int i = 0; i < kCArmJointCount; ++i) {
    const Joint joint = moved({state_.joints[i], state_.velocity[i]}, wanted_velocity[i], limits_.lower[i],
                              limits_.upper[i], limits_.acceleration[i], duration_s);
    state_.joints[i] = joint.position;
    state_.velocity[i] = joint.velocity;
  }
}

CArmState SimulatedCArm::state() const { return state_; }

CommandReceiver::CommandReceiver(const ReceiverSettings& settings) : settings_(settings) {
  checkSettings("receiver of commands", settings);
}

bool CommandReceiver::takes(std::int64_t time_us, std::int64_t sequence, std::int64_t valid_for_us,
                            const Eigen::Ref<const Eigen::VectorXd>& speeds, std::int64_t now_us,
                            const std::string& sender) {
  const CommandGate::Command command{sequence, time_us, speeds.isZero(0)};
  const auto refused = gate_.refusal(command, sender, now_us);
  const double age_ms = 1e-3 * (static_cast<double>(now_us) - static_cast<double>(time_us));
  const bool of_now = age_ms <= settings_.max_command_age_ms && age_ms >= -settings_.max_command_lead_ms;
  if (!speeds.allFinite()) {
    ++ignored_.not_finite;
  } else if (!command.stands_still && (valid_for_us <= 0 || valid_for_us > kMaxValidity_us)) {
    ++ignored_.bad_validity;
  } else if (refused) {
    count(*refused, sequence, sender, now_us);
  } else if (!command.stands_still && !of_now) {
    ++ignored_.too_old;
  } else if (speeds.cwiseAbs().maxCoeff() > settings_.max_overspeed) {
    ++ignored_.wrong_unit;  // Cut to the limits it would be full speed, in a direction that nobody meant.
  } else {
    gate_.obeyed(command, sender, now_us);
    return true;
  }
  return false;
}

void CommandReceiver::count(CommandGate::Refusal refusal, std::int64_t sequence, const std::string& sender,
                            std::int64_t now_us) {
  const std::string command = "a command with sequence " + std::to_string(sequence) +
                              (sender.empty() ? "" : " from " + sender) + " is not obeyed: ";
  switch (refusal) {
    case CommandGate::Refusal::kLate:
      ++ignored_.out_of_sequence;
      return;
    case CommandGate::Refusal::kJumped:
      if (ignored_.jumped++ == 0) news_.push_back(command + "too far ahead of the last one");
      return;
    case CommandGate::Refusal::kOtherSender:
      if (ignored_.other_sender++ == 0) {
        news_.push_back(command + "two programs command the machine, and it obeys " + gate_.sender(now_us) +
                        ": stop one");
      }
      return;
  }
}

std::optional<std::string> CommandReceiver::takeNews() {
  if (news_.empty()) return std::nullopt;
  std::string first = std::move(news_.front());
  news_.pop_front();
  return first;
}

}  // namespace angio::simulation

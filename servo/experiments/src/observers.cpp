// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/experiments/observers.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/formatted.hpp"

namespace angio::experiments {
namespace {

// Rounding of positions that are integrated over minutes; a thousandth of a limit is no excess to speak of.
constexpr double kStateRounding = 1e-9;
// Commands arrive on whole microseconds, a limiter reckons in real ones.
constexpr double kEnvelopeRounding = 1e-6;
// Of a speed limit: rounding of velocities that are integrated piece by piece.
constexpr double kSpeedRounding = 1e-6;
// Of an acceleration limit: what a machine that has nothing to go by must brake with at least.
constexpr double kMinBraking = 0.9;
constexpr std::int64_t kRemembered_us = 3'000'000;

}  // namespace

void LimitObserver::see(const AxesState& state) {
  const auto note = [&](Eigen::Index axis, const char* what, double value, double most) {
    if (!breach_) breach_ = formatted("axis %d: %s %.6g exceeds %.6g", static_cast<int>(axis), what, value, most);
  };
  if (!limits_.envelope.faces.empty()) {
    const CArmJoints joints = state.place;
    const auto* face = limits_.envelope.violated(joints);
    if (face && !breach_ && !(face->room(joints) >= -kEnvelopeRounding * face->normal.norm())) {
      breach_ = formatted("envelope: %s, by %.6g", face->name.c_str(), -face->room(joints));
    }
  }
  const double dt_s = last_ ? 1e-6 * static_cast<double>(state.time_us - last_->time_us) : 0;
  for (Eigen::Index i = 0; i < state.place.size(); ++i) {
    const double q = state.place[i], v = state.velocity[i];
    if (!std::isfinite(q) || !std::isfinite(v)) note(i, "state", q, limits_.upper[i]);
    if (!(q <= limits_.upper[i] + kStateRounding)) note(i, "position", q, limits_.upper[i]);
    if (!(q >= limits_.lower[i] - kStateRounding)) note(i, "position below", q, limits_.lower[i]);
    if (!(std::abs(v) <= limits_.velocity[i] + kStateRounding)) note(i, "speed", std::abs(v), limits_.velocity[i]);
    if (!(dt_s > 0)) continue;
    // The mean over the interval: never more than the largest within it.
    const double a = std::abs(v - last_->velocity[i]) / dt_s;
    if (!(a <= limits_.acceleration[i] * (1 + 1e-6) + kStateRounding))
      note(i, "acceleration", a, limits_.acceleration[i]);
  }
  last_ = state;
}

void CommandObserver::exposed(std::int64_t frame_sequence, std::int64_t now_us,
                              const std::optional<std::string>& spoilt) {
  frames_[frame_sequence] = {now_us, spoilt};
}

std::optional<std::string> CommandObserver::wrongWith(const AxesCommand& command, std::int64_t now_us,
                                                      double max_age_s) const {
  const auto frame = frames_.find(command.frame_sequence);
  if (frame == frames_.end()) return "by no frame at all";
  if (frame->second.spoilt) return "by a frame that was " + *frame->second.spoilt;
  const double age_s = 1e-6 * static_cast<double>(now_us - frame->second.time_us);
  if (age_s > max_age_s) return formatted("by a frame of %.0f ms before", 1e3 * age_s);
  return std::nullopt;
}

void CommandObserver::sent(const AxesCommand& command, std::int64_t now_us) {
  if (breach_ || command.velocity.isZero(0)) return;
  const auto within = (command.velocity.array().abs() <= (1 + kSpeedRounding) * limits_.velocity.array());
  if (const auto wrong = wrongWith(command, now_us, max_frame_age_s_)) breach_ = "the loop commands motion " + *wrong;
  if (!within.all()) breach_ = "the loop commands more than the machine's speed";
}

void CommandObserver::arrived(const AxesCommand& command, std::int64_t now_us) {
  const Order order{command, now_us, now_us + std::clamp<std::int64_t>(command.valid_for_us, 0, 1'000'000),
                    wrongWith(command, now_us, max_age_s_)};
  if (order.wrong && !command.velocity.isZero(0)) ++unsound_;
  orders_.push_back(order);
  while (!orders_.empty() && orders_.front().until_us < now_us - kRemembered_us) orders_.pop_front();
}

bool CommandObserver::explained(Eigen::Index axis, double speed, double sign, std::int64_t from_us,
                                std::int64_t to_us) const {
  return std::any_of(orders_.begin(), orders_.end(), [&](const Order& order) {
    return !order.wrong && order.arrived_us <= to_us && order.until_us >= from_us &&
           sign * order.command.velocity[axis] >= speed - kSpeedRounding * limits_.velocity[axis];
  });
}

std::string CommandObserver::suspect(Eigen::Index axis, double sign) const {
  for (auto order = orders_.rbegin(); order != orders_.rend(); ++order) {
    if (order->wrong && sign * order->command.velocity[axis] > 0) return *order->wrong;
  }
  return "by no command";
}

void CommandObserver::see(const AxesState& state) {
  if (last_ && !breach_ && state.time_us > last_->time_us) {
    const double dt_s = 1e-6 * static_cast<double>(state.time_us - last_->time_us);
    for (Eigen::Index i = 0; i < state.velocity.size(); ++i) {
      const double v = state.velocity[i], sign = v < 0 ? -1 : 1, before = std::max(0.0, sign * last_->velocity[i]);
      const double braked = std::max(0.0, before - kMinBraking * limits_.acceleration[i] * dt_s);
      if (std::abs(v) <= braked + kSpeedRounding * limits_.velocity[i]) continue;
      if (explained(i, std::abs(v), sign, last_->time_us, state.time_us)) continue;
      breach_ = formatted("axis %d moved at %.4g [rad/s, m/s] %s", static_cast<int>(i), v, suspect(i, sign).c_str());
      break;
    }
  }
  last_ = state;
}

TrajectoryObserver::TrajectoryObserver(const CArmGeometry& truth, const CArmJoints& start, const CArmJoints& goal,
                                       const Eigen::Vector3d& target_patient)
    : truth_(truth), target_(target_patient), wanted_(truth.T_camera_patient(goal) * target_patient) {
  box_.extend(Eigen::Vector3d(start.tail<3>()));
  box_.extend(Eigen::Vector3d(goal.tail<3>()));
  start_m_ = distance_m(start);
}

double TrajectoryObserver::distance_m(const CArmJoints& joints) const {
  return (truth_.T_camera_patient(joints) * target_ - wanted_).norm();
}

void TrajectoryObserver::see(const CArmJoints& joints) {
  table_m_ = box_.exteriorDistance(Eigen::Vector3d(joints.tail<3>()));
  target_m_ = distance_m(joints) - start_m_;
  max_table_m_ = std::max(max_table_m_, table_m_);
  max_target_m_ = std::max(max_target_m_, target_m_);
}

}  // namespace angio::experiments

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/safety_supervisor.hpp"

#include <cmath>
#include <utility>

#include "angio/base/errors.hpp"

namespace angio::servo {

FrameSupervisor::FrameSupervisor(const SupervisionSettings& settings, const CArmLimits& limits,
                                 const Eigen::Vector3d& target_model)
    : settings_(settings), target_(target_model), states_(settings.states), timing_(settings.freshness, limits) {
  checkSettings("safety", settings_);
}

FrameSupervisor::Requested FrameSupervisor::obey(const ServoRequest& request, std::int64_t now_us) {
  const ServoState before = states_.state();
  Requested requested;
  requested.refused = states_.request(request, timing_.newestFrame_us(), now_us);
  const bool changed = before != states_.state();
  requested.armed = changed && states_.state() == ServoState::kArmed;
  requested.reset = changed && request.request == ServoRequestKind::kReset;
  if (requested.reset) {  // A clock that was set right is no fault of what comes next.
    timing_.forget();
    unsound_arm_.reset();
    last_T_patient_model_.reset();
  }
  return requested;
}

std::optional<std::string> FrameSupervisor::raise(const Rejection& rejection, std::int64_t now_us) {
  if (rejection.cause == ServoCause::kFrameDoubted) {
    states_.reject(RejectionKind::kUnseen, rejection.reason, now_us);
  } else {
    states_.fault(rejection.cause, rejection.reason, now_us);
  }
  return rejection.reason;
}

// A state that comes twice or late says nothing new, and nothing bad.
bool FrameSupervisor::sound(const CArmState& newest, std::int64_t now_us, const std::string& sender) {
  const auto wrong = timing_.rejection(newest, now_us, sender);
  const bool fault = wrong && wrong->cause != ServoCause::kFrameDoubted;
  unsound_arm_ = fault ? raise(*wrong, now_us) : std::nullopt;
  return !wrong;
}

bool FrameSupervisor::sound(const CatheterState& newest, std::int64_t now_us, const std::string& sender) {
  const auto wrong = timing_.rejection(newest, now_us, sender);
  if (wrong && wrong->cause != ServoCause::kFrameDoubted) raise(*wrong, now_us);
  return !wrong;
}

std::optional<std::string> FrameSupervisor::begin(const XrayFrame& frame, std::int64_t now_us,
                                                  const std::string& sender) {
  if (const auto wrong = timing_.rejection(frame, now_us, sender)) return raise(*wrong, now_us);
  if (unsound_arm_) states_.reject(RejectionKind::kUnseen, *unsound_arm_, now_us);
  return unsound_arm_;
}

void FrameSupervisor::accept(const Pose& T_patient_model, const Eigen::Vector3d& beam_patient, std::int64_t now_us) {
  const auto last = std::exchange(last_T_patient_model_, T_patient_model);
  if (last && !states_.moves()) {  // The start guard: frames that are right one by one must be right together.
    const double turned_deg = radToDeg(rotationAngle(T_patient_model.linear() * last->linear().transpose()));
    const Eigen::Vector3d moved = T_patient_model * target_ - *last * target_;
    const double depth_mm = 1e3 * std::abs(moved.dot(beam_patient)), moved_mm = 1e3 * moved.cross(beam_patient).norm();
    if (!(turned_deg <= settings_.max_start_spread_deg) || !(moved_mm <= settings_.max_start_spread_mm) ||
        !(depth_mm <= settings_.max_start_spread_depth_mm)) {
      states_.reject(RejectionKind::kContradiction,
                     "consecutive frames disagree by " + formatValue(turned_deg) + " deg, " + formatValue(moved_mm) +
                         " mm, in depth " + formatValue(depth_mm) + " mm",
                     now_us);
      return;
    }
  }
  states_.accept(now_us);
}

void FrameSupervisor::reject(RejectionKind kind, const std::string& reason, std::int64_t now_us) {
  last_T_patient_model_.reset();
  states_.reject(kind, reason, now_us);
}

}  // namespace angio::servo

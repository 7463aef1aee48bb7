// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/safety_supervisor.hpp"

#include <cmath>
#include <utility>

#include "angio/base/errors.hpp"

namespace angio {

SafetySupervisor::SafetySupervisor(const SafetySettings& settings, const CArmLimits& limits,
                                   const Eigen::Vector3d& target_model)
    : settings_(settings),
      target_(target_model),
      states_(settings.states),
      freshness_(settings.freshness, limits),
      motion_(settings.motion, limits) {
  checkSettings("safety", settings_);
}

std::optional<std::string> SafetySupervisor::request(const ServoRequest& request, std::int64_t now_us) {
  const ServoState before = states_.state();
  auto refused = states_.request(request, freshness_.newestFrame_us(), now_us);
  // A machine that was moved by hand, or a clock that was set right, is no fault of what comes next.
  if (before != states_.state() && states_.state() == ServoState::kArmed) motion_.forget();
  if (before != states_.state() && request.request == ServoRequestKind::kReset) {
    freshness_.forget();
    motion_.forget();
    last_T_patient_model_.reset();
  }
  return refused;
}

std::optional<std::string> SafetySupervisor::raise(const Objection& objection, std::int64_t now_us) {
  if (objection.cause == ServoCause::kFrameDoubted) {
    states_.doubted(Doubt::kUnseen, objection.reason, now_us);
  } else {
    states_.fault(objection.cause, objection.reason, now_us);
  }
  return objection.reason;
}

void SafetySupervisor::observe(const CArmState& newest, std::int64_t now_us) {
  const auto wrong = freshness_.objection(newest, now_us);
  // Joints that come twice or late say nothing new, and nothing bad.
  if (wrong && wrong->cause != ServoCause::kFrameDoubted) raise(*wrong, now_us);
  if (wrong) return;
  if (const auto astray = motion_.measured(newest)) states_.fault(ServoCause::kMotionDisagrees, *astray, now_us);
}

std::optional<std::string> SafetySupervisor::begin(const XrayFrame& frame, std::int64_t now_us) {
  const auto wrong = freshness_.objection(frame, now_us);
  if (!wrong) return std::nullopt;
  return raise(*wrong, now_us);
}

void SafetySupervisor::trust(const Pose& T_patient_model, const Eigen::Vector3d& beam_patient, std::int64_t now_us) {
  const auto last = std::exchange(last_T_patient_model_, T_patient_model);
  if (last && !states_.moves()) {  // The start guard: frames that are right one by one must be right together.
    const double turned_deg = radToDeg(rotationAngle(T_patient_model.linear() * last->linear().transpose()));
    const Eigen::Vector3d moved = T_patient_model * target_ - *last * target_;
    const double depth_mm = 1e3 * std::abs(moved.dot(beam_patient)), moved_mm = 1e3 * moved.cross(beam_patient).norm();
    if (!(turned_deg <= settings_.most_start_spread_deg) || !(moved_mm <= settings_.most_start_spread_mm) ||
        !(depth_mm <= settings_.most_start_spread_depth_mm)) {
      states_.doubted(Doubt::kContradiction,
                      "consecutive frames disagree by " + shown(turned_deg) + " deg, " + shown(moved_mm) +
                          " mm, in depth " + shown(depth_mm) + " mm",
                      now_us);
      return;
    }
  }
  states_.trusted(now_us);
}

void SafetySupervisor::doubt(Doubt kind, const std::string& reason, std::int64_t now_us) {
  last_T_patient_model_.reset();
  states_.doubted(kind, reason, now_us);
}

void SafetySupervisor::wait(std::int64_t now_us) { states_.wait(now_us); }

CArmJoints SafetySupervisor::permitted(const CArmJoints& velocity) const {
  return states_.moves() && velocity.allFinite() ? velocity : CArmJoints::Zero();
}

}  // namespace angio

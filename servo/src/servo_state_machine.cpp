// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_state_machine.hpp"

#include <cmath>
#include <utility>

#include "angio/base/errors.hpp"

namespace angio::servo {
namespace {

constexpr std::size_t kMaxLog = 256;

double between_ms(std::int64_t from_us, std::int64_t to_us) {
  return 1e-3 * (static_cast<double>(to_us) - static_cast<double>(from_us));  // The difference may not fit an integer.
}

std::pair<ServoEvent, ServoCause> meaningOf(ServoRequestKind request) {
  switch (request) {
    case ServoRequestKind::kArm:
      return {ServoEvent::kArm, ServoCause::kArmRequested};
    case ServoRequestKind::kStart:
      return {ServoEvent::kStart, ServoCause::kStartRequested};
    case ServoRequestKind::kReset:
      return {ServoEvent::kReset, ServoCause::kResetRequested};
    case ServoRequestKind::kEmergencyStop:
      return {ServoEvent::kEmergencyStop, ServoCause::kEmergencyStopRequested};
    case ServoRequestKind::kStop:
      break;
  }
  return {ServoEvent::kStop, ServoCause::kStopRequested};  // An unknown number stops, too.
}

}  // namespace

ServoState stateAfter(ServoState state, ServoEvent event) {
  using State = ServoState;
  const bool latched = state == State::kFault || state == State::kEmergencyStop;
  const bool active = state == State::kArmed || state == State::kHold || state == State::kServo;
  switch (event) {
    case ServoEvent::kEmergencyStop:
      return State::kEmergencyStop;
    case ServoEvent::kReset:
      return latched ? State::kIdle : state;
    case ServoEvent::kStop:
      return active ? State::kIdle : state;
    case ServoEvent::kArm:
      return state == State::kIdle ? State::kArmed : state;
    case ServoEvent::kStart:
      return state == State::kArmed ? State::kHold : state;
    case ServoEvent::kAccepted:
      return state == State::kHold ? State::kServo : state;
    case ServoEvent::kRejected:
      return state == State::kServo ? State::kHold : state;
    case ServoEvent::kFault:
      return active ? State::kFault : state;
  }
  return State::kFault;
}

ServoStateMachine::ServoStateMachine(const ServoStateSettings& settings) : settings_(settings) {
  checkSettings("servo states", settings_);
}

bool ServoStateMachine::active() const { return stateAfter(state_, ServoEvent::kFault) != state_; }

// Times are compared in every call, so that no timeout can be set back.
bool ServoStateMachine::clockRuns(std::int64_t now_us) {
  const bool back = now_us_ && now_us < *now_us_;
  if (back) {
    const double by_ms = between_ms(now_us, *now_us_);
    last_frame_us_.reset();
    contradicted_since_us_.reset();
    now_us_ = now_us;
    fault(ServoCause::kClockJumped, "the loop's clock ran back by " + formatValue(by_ms) + " ms", now_us);
  }
  now_us_ = now_us;
  return !back;
}

void ServoStateMachine::change(ServoEvent event, ServoCause cause, const std::string& reason, std::int64_t now_us) {
  const ServoState next = stateAfter(state_, event);
  if (next == ServoState::kHold && event == ServoEvent::kRejected) reason_ = reason;
  if (next == state_) return;
  log_.push_back({state_, next, cause, now_us, reason});
  if (log_.size() > kMaxLog) log_.pop_front();
  ++transitions_;
  state_ = next;
  reason_ = next == ServoState::kServo ? "" : reason;
  if (next == ServoState::kArmed || next == ServoState::kIdle) {  // Both begin afresh.
    accepted_in_a_row_ = 0;
    has_moved_ = false;
    last_frame_us_.reset();
    contradicted_since_us_.reset();
  }
  if (next == ServoState::kServo) has_moved_ = true;
  if (event == ServoEvent::kStart && !last_frame_us_) last_frame_us_ = now_us;  // Frames are due from now on.
}

std::optional<std::string> ServoStateMachine::refusal(const ServoRequest& request, std::int64_t newest_frame_us) const {
  if (last_request_ && request.sequence <= last_request_->sequence &&
      !(request.sequence < last_request_->sequence && request.time_us > last_request_->time_us)) {
    return "the request came twice or late";
  }
  if (request.transitions != transitions_) return "the request answers another state than the present one";
  const double age_ms = newest_frame_us == 0 ? 0 : std::abs(between_ms(request.status_time_us, newest_frame_us));
  if (!(age_ms <= settings_.max_request_age_ms)) {
    return "the request answers a status " + formatValue(age_ms) + " ms from now: at most " +
           formatValue(settings_.max_request_age_ms);
  }
  return std::nullopt;
}

std::optional<std::string> ServoStateMachine::request(const ServoRequest& request, std::int64_t newest_frame_us,
                                                      std::int64_t now_us) {
  clockRuns(now_us);
  const auto [event, cause] = meaningOf(request.request);
  // What stops is never too late.
  const bool stops = event == ServoEvent::kStop || event == ServoEvent::kEmergencyStop;
  const auto refused = stops ? std::nullopt : refusal(request, newest_frame_us);
  if (!last_request_ || request.time_us > last_request_->time_us) last_request_ = request;
  if (refused) return refused;
  const ServoState before = state_;
  change(event, cause, nameOf(cause), now_us);
  if (state_ == before && !stops && stateAfter(before, event) == before) {
    return std::string("the request means nothing in state ") + nameOf(before);
  }
  return std::nullopt;
}

void ServoStateMachine::accept(std::int64_t now_us) {
  if (!clockRuns(now_us)) return;
  wait(now_us);  // One frame after a long silence does not undo it.
  last_frame_us_ = now_us;
  contradicted_since_us_.reset();
  const int wanted = has_moved_ ? settings_.frames_to_resume : settings_.frames_to_start;
  if (accepted_in_a_row_ < wanted) ++accepted_in_a_row_;
  if (accepted_in_a_row_ >= wanted) {
    change(ServoEvent::kAccepted, ServoCause::kFramesTrusted, nameOf(ServoCause::kFramesTrusted), now_us);
  } else if (state_ == ServoState::kHold) {
    reason_ = std::to_string(accepted_in_a_row_) + " of " + std::to_string(wanted) + " trusted frames in a row";
  }
}

void ServoStateMachine::reject(RejectionKind kind, const std::string& reason, std::int64_t now_us) {
  if (!clockRuns(now_us)) return;
  last_frame_us_ = now_us;
  accepted_in_a_row_ = 0;
  change(ServoEvent::kRejected, ServoCause::kFrameDoubted, reason, now_us);
  if (kind != RejectionKind::kContradiction) return;  // Frames without vessels do not end a contradiction.
  if (!contradicted_since_us_) contradicted_since_us_ = now_us;
  if (between_ms(*contradicted_since_us_, now_us) > settings_.max_contradiction_ms) {
    fault(ServoCause::kViewDisagrees, reason, now_us);
  }
}

void ServoStateMachine::fault(ServoCause cause, const std::string& reason, std::int64_t now_us) {
  accepted_in_a_row_ = 0;
  change(ServoEvent::kFault, cause, std::string(nameOf(cause)) + ": " + reason, now_us);
}

void ServoStateMachine::wait(std::int64_t now_us, const std::function<std::string()>& silence) {
  if (!clockRuns(now_us) || !last_frame_us_) return;
  const double gap_ms = between_ms(*last_frame_us_, now_us);
  if (gap_ms <= settings_.max_frame_gap_ms) return;
  const std::string heard = silence ? silence() : std::string();
  const std::string reason = (heard.empty() ? "no frame" : heard + ",") + " for " + formatValue(gap_ms) + " ms";
  accepted_in_a_row_ = 0;
  change(ServoEvent::kRejected, ServoCause::kFramesLate, reason, now_us);
  if (gap_ms > settings_.frames_gone_ms) fault(ServoCause::kFramesGone, reason, now_us);
}

void ServoStateMachine::describe(ServoStatus& status) const {
  status.state = state_;
  status.reason = reason_;
  status.transitions = transitions_;
  if (log_.empty()) return;
  status.transition_time_us = log_.back().time_us;
  status.cause = log_.back().cause;
}

}  // namespace angio::servo

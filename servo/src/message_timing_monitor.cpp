// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/message_timing_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "angio/base/errors.hpp"
#include "angio/servo/motion_monitor.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/time_stamp.hpp"

namespace angio::servo {
namespace {

// A degree is 57 radians' worth and a millimetre a thousand metres': what is this far out is no encoder's error.
constexpr double kImplausible = 3;

// What a joint moves beyond its speed limit in a moment that encoders' and clocks' errors explain.
constexpr double kSpeedMargin = 1.5;

double between_us(std::int64_t from, std::int64_t to) { return static_cast<double>(to) - static_cast<double>(from); }

bool sameImage(const cv::Mat& a, const cv::Mat& b) {
  if (a.empty() || a.size() != b.size() || a.type() != b.type()) return false;
  const std::size_t row_bytes = static_cast<std::size_t>(a.cols) * a.elemSize();
  for (int y = 0; y < a.rows; ++y) {  // Quantum noise ends this within the first row of any new image.
    if (std::memcmp(a.ptr(y), b.ptr(y), row_bytes) != 0) return false;
  }
  return true;
}

}  // namespace

MessageTimingMonitor::MessageTimingMonitor(const MessageTimingSettings& settings, const CArmLimits& limits)
    : settings_(settings), limits_(limits) {
  checkSettings("freshness", settings_);
}

void MessageTimingMonitor::forget() {
  frame_.reset();
  joints_.reset();
  drive_.reset();
  last_state_.reset();
  last_image_.release();
}

const MessageTimingMonitor::Stream MessageTimingMonitor::kFrames{kXrayFrameChannel, "frames", "X-rays"};
const MessageTimingMonitor::Stream MessageTimingMonitor::kJoints{kCArmStateChannel, "joints", "C-arms"};
const MessageTimingMonitor::Stream MessageTimingMonitor::kDrive{kCatheterStateChannel, "the drive's states",
                                                                "catheter drives"};

// Order and clock of one sender's messages.
std::optional<Rejection> MessageTimingMonitor::follow(std::optional<Arrival>& last, Arrival next,
                                                      const Stream& stream) const {
  const std::string what = stream.messages;
  if (!last) {
    last = std::move(next);
    return std::nullopt;
  }
  if (next.sequence <= last->sequence && next.time_us <= last->time_us) {
    return Rejection{ServoCause::kFrameDoubted, what + " came twice or late"};
  }
  const double passed_us = between_us(last->now_us, next.now_us), ticked_us = between_us(last->time_us, next.time_us);
  const bool began_again = next.sequence < last->sequence;
  const bool jumped = ticked_us <= 0 || ticked_us - passed_us > 1e3 * settings_.max_clock_jump_ms;
  if (!began_again && !jumped) {
    next.min_lag_us = std::min(next.min_lag_us, last->min_lag_us + 1e-6 * settings_.clock_drift_ppm * passed_us);
  }
  const Arrival before = *std::exchange(last, std::move(next));
  if (began_again) return Rejection{ServoCause::kFrameDoubted, "the sender of " + what + " began again"};
  if (!jumped) return std::nullopt;
  if (before.sender != last->sender && !before.sender.empty()) {
    return Rejection{ServoCause::kSecondSender, std::string("two ") + stream.senders + " on " + stream.channel +
                                                    ", or one that was started again: " + before.sender + " and now " +
                                                    last->sender + ": stop one, and reset"};
  }
  if (differentEpochs(before.time_us, last->time_us)) {
    return Rejection{ServoCause::kClockJumped, "the clock of " + sourceOf({stream.channel, last->sender, 0}) +
                                                   " counts from another epoch than before: utime " +
                                                   timeInWords(last->time_us) + " after " +
                                                   timeInWords(before.time_us)};
  }
  return Rejection{ServoCause::kClockJumped, what + " went on by " + formatValue(1e-3 * ticked_us) + " ms in " +
                                                 formatValue(1e-3 * passed_us) + " ms"};
}

std::optional<Rejection> MessageTimingMonitor::rejection(const XrayFrame& frame, std::int64_t now_us,
                                                         const std::string& sender) {
  if (auto wrong = follow(frame_, arrival(frame, now_us, sender), kFrames)) return wrong;
  const bool frozen = sameImage(frame.image, last_image_);
  last_image_ = frame.image;
  const auto doubt = [](std::string reason) { return Rejection{ServoCause::kFrameDoubted, std::move(reason)}; };
  if (frozen) return doubt("the image is frozen: a new frame with the last one's pixels");
  const TimeStamp exposed{kXrayFrameChannel, sender, frame.time_us};
  const std::pair<const std::optional<Arrival>&, const Stream&> states[] = {{joints_, kJoints}, {drive_, kDrive}};
  for (const auto& [newest, stream] : states) {
    if (!newest) continue;
    if (auto far = differentEpochs(exposed, {stream.channel, newest->sender, newest->time_us})) return doubt(*far);
  }
  const auto tooOld = [&](double age_us, const char* against) -> std::optional<Rejection> {
    if (age_us <= 1e3 * settings_.max_frame_age_ms) return std::nullopt;
    return doubt("the frame is " + formatValue(1e-3 * age_us) + " ms later than " + against + ": at most " +
                 formatValue(settings_.max_frame_age_ms));
  };
  if (auto old = tooOld(between_us(frame.time_us, now_us) - frame_->min_lag_us, "the quickest")) return old;
  return joints_ ? tooOld(between_us(frame.time_us, joints_->time_us), "the newest joints") : std::nullopt;
}

std::optional<Rejection> MessageTimingMonitor::implausible(const CArmState& state) const {
  const auto about = [](int joint, double value, const char* what) {
    return std::string(kJointNames[joint]) + " at " + formatValue(value) + what;
  };
  for (int i = 0; i < kCArmJointCount; ++i) {
    const double q = state.joints[i], middle = 0.5 * (limits_.lower[i] + limits_.upper[i]);
    const double half_range = 0.5 * (limits_.upper[i] - limits_.lower[i]);
    const double margin = i < 2 ? settings_.limit_margin_deg * kPi / 180 : 1e-3 * settings_.limit_margin_mm;
    if (std::abs(q - middle) > kImplausible * half_range + margin) {
      return Rejection{ServoCause::kJointsImplausible, about(i, q, ", far out of its range: in wrong units?")};
    }
    if (std::abs(state.velocity[i]) > kImplausible * limits_.velocity[i]) {
      return Rejection{ServoCause::kJointsImplausible, about(i, state.velocity[i], " a second: in wrong units?")};
    }
    if (last_state_) {
      const double dt_s = 1e-6 * between_us(last_state_->time_us, state.time_us), moved = q - last_state_->joints[i];
      if (std::abs(moved) > kSpeedMargin * limits_.velocity[i] * std::max(0.0, dt_s) + margin) {
        return Rejection{ServoCause::kJointsImplausible, about(i, q, ", further than it can have moved")};
      }
    }
    if (std::abs(q - middle) > half_range + margin) {
      return Rejection{ServoCause::kJointLimitBroken, about(i, q, "")};
    }
  }
  return std::nullopt;
}

std::optional<Rejection> MessageTimingMonitor::rejection(const CArmState& state, std::int64_t now_us,
                                                         const std::string& sender) {
  if (!state.joints.allFinite() || !state.velocity.allFinite()) {
    return Rejection{ServoCause::kJointsNotFinite, "joint positions or velocities are NaN or infinite"};
  }
  if (joints_ && state.sequence == joints_->sequence && state.time_us == joints_->time_us) return std::nullopt;
  if (auto wrong = follow(joints_, arrival(state, now_us, sender), kJoints)) return wrong;
  const auto wrong = implausible(state);
  last_state_ = state;
  return wrong;
}

std::optional<Rejection> MessageTimingMonitor::rejection(const CatheterState& state, std::int64_t now_us,
                                                         const std::string& sender) {
  if (drive_ && state.sequence == drive_->sequence && state.time_us == drive_->time_us) return std::nullopt;
  return follow(drive_, arrival(state, now_us, sender), kDrive);
}

}  // namespace angio::servo

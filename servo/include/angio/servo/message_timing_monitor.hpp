// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "angio/base/settings.hpp"
#include "angio/servo/namespace.hpp"
#include "angio/types/any_message.hpp"

namespace angio::servo {

/// How old messages may be, how far clocks may drift or jump, and how far beyond their range joints may be said to be.
struct MessageTimingSettings {
  double max_frame_age_ms = 300;
  double max_clock_jump_ms = 1000;
  static constexpr double clock_drift_ppm =
      200;  ///< That a sender's clock may lose for ever: what is called the quickest frame follows.
  static constexpr double limit_margin_deg = 0.5;  ///< Beyond the end of a range, for encoders.
  static constexpr double limit_margin_mm = 2;

  void visit(SettingsVisitor& v) {
    v.number("max_frame_age_ms", max_frame_age_ms, 1, 10e3,
             "How much later than the quickest frames, or than the newest joints, a frame may be");
    v.number("max_clock_jump_ms", max_clock_jump_ms, 1, 600e3,
             "How much a sender's clock may gain on ours between two messages");
  }
};

/// What speaks against a message. A cause other than kFrameDoubted is a fault.
struct Rejection {
  ServoCause cause = ServoCause::kFrameDoubted;
  std::string reason;
};

/// Whether frames and joints are of now, in order, moving on, and in the units they should be in.
///
/// Senders' clocks need not be ours. How late a message is counts from the quickest one so far, so a delay that never
/// changes is not seen against our clock; against the newest joints, whose sender's clock is the frames', it is.
class MessageTimingMonitor {
 public:
  /// Throws InputError when a setting is out of its range.
  MessageTimingMonitor(const MessageTimingSettings& settings, const CArmLimits& limits);

  /// What speaks against a frame that is read at `now_us`, our clock [us]. Keeps its image until the next one: pixels
  /// that are the same under a new sequence number are no new look.
  /// @param sender  As the bus names it, here and below; empty: unknown. Clocks of two senders are not called one that
  ///                jumps.
  std::optional<Rejection> rejection(const XrayFrame& frame, std::int64_t now_us, const std::string& sender = {});

  /// What speaks against the newest joints. Joints far out of their range or speed are in wrong units.
  std::optional<Rejection> rejection(const CArmState& state, std::int64_t now_us, const std::string& sender = {});

  /// What speaks against the newest state of a catheter's drive.
  std::optional<Rejection> rejection(const CatheterState& state, std::int64_t now_us, const std::string& sender = {});

  /// Time of the newest frame, its sender's clock [us]; 0 when none has come.
  std::int64_t newestFrame_us() const { return frame_ ? frame_->time_us : 0; }

  /// Forgets all senders, for a start anew.
  void forget();

 private:
  struct Arrival {
    std::int64_t now_us, time_us, sequence;
    double min_lag_us;  // Our clock less the sender's, of the quickest message.
    std::string sender;
  };
  template <typename Message>
  static Arrival arrival(const Message& message, std::int64_t now_us, const std::string& sender) {
    const double lag_us = static_cast<double>(now_us) - static_cast<double>(message.time_us);
    return {now_us, message.time_us, message.sequence, lag_us, sender};
  }
  // What one channel's messages and their senders are called.
  struct Stream {
    const char *channel, *messages, *senders;
  };
  static const Stream kFrames, kJoints, kDrive;

  std::optional<Rejection> follow(std::optional<Arrival>& last, Arrival next, const Stream& stream) const;
  std::optional<Rejection> implausible(const CArmState& state) const;

  MessageTimingSettings settings_;
  CArmLimits limits_;
  std::optional<Arrival> frame_, joints_, drive_;
  std::optional<CArmState> last_state_;
  cv::Mat last_image_;
};

}  // namespace angio::servo

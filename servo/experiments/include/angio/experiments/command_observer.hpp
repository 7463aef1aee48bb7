// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>

#include "angio/experiments/axes.hpp"

namespace angio::experiments {

/// Watches what a machine truly does beside what is on the wire, for motion that nothing sound explains, and what its
/// loop tells it. Knows which frames were true; asks nothing of the code that is to keep the machine safe.
///
/// An axis may gain speed, or keep it, only while a command is in force that asks for that much in that direction, was
/// made from a true frame, and came no later than `max_age_s` after its exposure. Otherwise it has to brake. A loop
/// may send motion only for a true frame no older than `max_frame_age_s`, and only finite speeds within their limits.
class CommandObserver {
 public:
  CommandObserver(const AxesLimits& limits, double max_age_s, double max_frame_age_s)
      : limits_(limits), max_age_s_(max_age_s), max_frame_age_s_(max_frame_age_s) {}

  /// A frame was exposed [us, the lab's clock]; `spoilt` says how what was sent of it is not the truth.
  void exposed(std::int64_t frame_sequence, std::int64_t now_us, const std::optional<std::string>& spoilt);

  /// The loop has sent a command.
  void sent(const AxesCommand& command, std::int64_t now_us);

  /// A command has reached the machine.
  void arrived(const AxesCommand& command, std::int64_t now_us);

  /// The machine's true state, in the order of time.
  void see(const AxesState& state);

  /// The first motion that nothing explains, or that was commanded by what does not allow it; nothing while there was
  /// none.
  const std::optional<std::string>& breach() const { return breach_; }

  /// Commands for motion that arrived and were too old, or made from frames that were not true.
  int unsound() const { return unsound_; }

 private:
  struct Seen {
    std::int64_t time_us;
    std::optional<std::string> spoilt;
  };
  struct Order {
    AxesCommand command;
    std::int64_t arrived_us, until_us;
    std::optional<std::string> wrong;
  };

  std::optional<std::string> wrongWith(const AxesCommand& command, std::int64_t now_us, double max_age_s) const;
  bool explained(Eigen::Index axis, double speed, double sign, std::int64_t from_us, std::int64_t to_us) const;
  std::string suspect(Eigen::Index axis, double sign) const;

  AxesLimits limits_;
  double max_age_s_, max_frame_age_s_;
  std::map<std::int64_t, Seen> frames_;
  std::deque<Order> orders_;
  std::optional<AxesState> last_;
  std::optional<std::string> breach_;
  int unsound_ = 0;
};

}  // namespace angio::experiments

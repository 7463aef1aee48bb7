// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>

#include "angio/messaging/messages.hpp"

namespace angio {

/// Watches what a C-arm truly does beside what is on the wire, for motion that nothing sound explains. Knows which
/// frames were true; asks nothing of the code that is to keep the machine safe.
///
/// A joint may gain speed, or keep it, only while a command is in force that asks for that much in that direction, was
/// made from a true frame, and came no later than `most_age_s` after its exposure. Otherwise it has to brake.
class CommandObserver {
 public:
  CommandObserver(const CArmLimits& limits, double most_age_s) : limits_(limits), most_age_s_(most_age_s) {}

  /// A frame was exposed [us, the room's clock]; `spoilt` says how what was sent of it is not the truth.
  void exposed(std::int64_t frame_sequence, std::int64_t now_us, const std::optional<std::string>& spoilt);

  /// A command has reached the machine.
  void arrived(const CArmCommand& command, std::int64_t now_us);

  /// The machine's true state, in the order of time.
  void see(const CArmState& state);

  /// The first motion that nothing explains; nothing while there was none.
  const std::optional<std::string>& breach() const { return breach_; }

  /// Commands for motion that arrived and were too old, or made from frames that were not true.
  int unsound() const { return unsound_; }

 private:
  struct Seen {
    std::int64_t time_us;
    std::optional<std::string> spoilt;
  };
  struct Order {
    CArmCommand command;
    std::int64_t arrived_us, until_us;
    std::optional<std::string> wrong;
  };

  bool explained(int joint, double speed, double sign, std::int64_t from_us, std::int64_t to_us) const;
  std::string suspect(int joint, double sign) const;

  CArmLimits limits_;
  double most_age_s_;
  std::map<std::int64_t, Seen> frames_;
  std::deque<Order> orders_;
  std::optional<CArmState> last_;
  std::optional<std::string> breach_;
  int unsound_ = 0;
};

}  // namespace angio

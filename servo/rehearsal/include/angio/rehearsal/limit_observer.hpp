// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/messaging/messages.hpp"

namespace angio {

/// Watches a C-arm's true motion for what it must never do: leave a joint's range or the
/// envelope, exceed its speed or its acceleration. Judges by the states alone, not by the code that is to keep the
/// limits.
class LimitObserver {
 public:
  explicit LimitObserver(const CArmLimits& limits) : limits_(limits) {}

  /// The arm's next state, in the order of time.
  void see(const CArmState& state);

  /// What was exceeded first, by which joint and how far; nothing while all was kept.
  const std::optional<std::string>& breach() const { return breach_; }

  /// Largest share of its limit that any joint's speed and acceleration reached; 1 is the limit.
  double speedShare() const { return speed_share_; }
  double accelerationShare() const { return acceleration_share_; }

 private:
  CArmLimits limits_;
  std::optional<CArmState> last_;
  std::optional<std::string> breach_;
  double speed_share_ = 0, acceleration_share_ = 0;
};

}  // namespace angio

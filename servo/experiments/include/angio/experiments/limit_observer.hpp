// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/experiments/axes.hpp"

namespace angio::experiments {

/// Watches a machine's true motion for what it must never do: leave an axis' range or the envelope, exceed its speed or
/// its acceleration. Judges by the states alone, not by the code that is to keep the
/// limits.
class LimitObserver {
 public:
  explicit LimitObserver(const AxesLimits& limits) : limits_(limits) {}

  /// The machine's next state, in the order of time.
  void see(const AxesState& state);

  /// What was exceeded first, by which axis and how far; nothing while all was kept.
  const std::optional<std::string>& breach() const { return breach_; }

  /// Largest share of its limit that any axis's speed and acceleration reached; 1 is the limit.
  double speedShare() const { return speed_share_; }
  double accelerationShare() const { return acceleration_share_; }

 private:
  AxesLimits limits_;
  std::optional<AxesState> last_;
  std::optional<std::string> breach_;
  double speed_share_ = 0, acceleration_share_ = 0;
};

}  // namespace angio::experiments

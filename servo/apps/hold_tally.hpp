// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "angio/apps/namespace.hpp"
#include "angio/base/formatted.hpp"
#include "loop_warnings.hpp"

namespace angio::apps {

/// Counts the frames of a run that were held, by their reasons. Reasons that differ in numbers only are one.
class HoldTally {
 public:
  void count(const std::optional<std::string>& hold_reason) {
    ++frames_;
    if (!hold_reason) return;
    ++held_;
    Reason& reason = reasons_[withoutNumbers(*hold_reason)];
    ++reason.count;
    reason.last = *hold_reason;
  }

  int frames() const { return frames_; }
  int held() const { return held_; }

  /// Returns nothing when a frame moved the machine or could have; otherwise why none did, the commonest reasons first.
  /// Nothing either of a run that had hardly time for its start.
  std::optional<std::string> neverMoved() const {
    if (frames_ == 0) return "the loop never moved: no frame was answered";
    if (held_ < frames_ || frames_ < kStart) return std::nullopt;
    std::vector<Reason> reasons;
    for (const auto& [kind, reason] : reasons_) reasons.push_back(reason);
    std::stable_sort(reasons.begin(), reasons.end(),
                     [](const Reason& a, const Reason& b) { return a.count > b.count; });
    reasons.resize(std::min(reasons.size(), kTold));
    std::string text = formatted("the loop never moved: all of %d frames were held", frames_);
    for (const Reason& reason : reasons) text += formatted("; %d: ", reason.count) + reason.last;
    return text;
  }

 private:
  struct Reason {
    int count = 0;
    std::string last;
  };
  static constexpr std::size_t kTold = 3;
  static constexpr int kStart = 8;  // Frames: half a second at 15 a second, of which arming takes a part.
  int frames_ = 0, held_ = 0;
  std::map<std::string, Reason> reasons_;
};

}  // namespace angio::apps

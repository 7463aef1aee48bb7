// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/base/formatted.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/messaging/namespace.hpp"
#include "angio/types/loop_input.hpp"

// What the lines of several messages have in common.
namespace angio::messaging::wire {

inline long long count(std::int64_t number) { return static_cast<long long>(number); }

/// The beginning of a text from the bus, without what would move a terminal's cursor.
inline std::string harmless(const std::string& text) {
  constexpr std::size_t kMaxShown = 60;
  std::string shown = text.substr(0, kMaxShown);
  for (char& c : shown) {
    if (c < 0x20 || c >= 0x7f) c = '?';
  }
  return text.size() > kMaxShown ? shown + "..." : shown;
}

inline std::string jointsText(const CArmJoints& q, const char* per_s = "") {
  return formatted("%+.2f %+.2f deg%s, table %+.1f %+.1f %+.1f mm%s", radToDeg(q[0]), radToDeg(q[1]), per_s, 1e3 * q[2],
                   1e3 * q[3], 1e3 * q[4], per_s);
}

inline std::string verdictText(std::int64_t frame_sequence, ServoVerdict verdict) {
  constexpr const char* kVerdicts[kServoVerdictCount] = {"", ", taken back", ", refused"};
  return formatted("frame %lld%s with ", count(frame_sequence), kVerdicts[static_cast<int>(verdict)]);
}

inline std::string answerText(std::int64_t frame_sequence, std::int64_t valid_for_us) {
  return formatted("frame %lld, for %.0f ms: ", count(frame_sequence), 1e-3 * static_cast<double>(valid_for_us));
}

}  // namespace angio::messaging::wire

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/replay.hpp"

#include <cstring>

#include "angio/base/formatted.hpp"

namespace angio::servo {
namespace {

// Of what every machine's command has.
template <typename Command>
std::optional<std::string> differenceInName(const Command& replayed, const Command& logged) {
  if (auto d = difference("utime", replayed.time_us, logged.time_us)) return d;
  if (auto d = difference("frame_sequence", replayed.frame_sequence, logged.frame_sequence)) return d;
  if (auto d = difference("sequence", replayed.sequence, logged.sequence)) return d;
  return difference("valid_for_us", replayed.valid_for_us, logged.valid_for_us);
}

}  // namespace

void ReplaySummary::differs(const std::string& how) {
  if (!first_difference) first_difference = how;
}

void ReplaySummary::compare(const std::string& frame, const std::optional<std::string>& difference) {
  ++compared;
  equal += !difference;
  if (difference) differs(frame + ": " + *difference);
}

void ReplaySummary::finish() {
  if (compared >= commands) return;
  differs(std::to_string(commands - compared) + " commands cannot be compared: what they answer is not in the log");
}

std::optional<std::string> difference(const std::string& field, std::int64_t replayed, std::int64_t logged) {
  if (replayed == logged) return std::nullopt;
  return field + " = " + std::to_string(replayed) + " replayed, " + std::to_string(logged) + " logged";
}

std::optional<std::string> difference(const std::string& field, double replayed, double logged) {
  if (std::memcmp(&replayed, &logged, sizeof(double)) == 0) return std::nullopt;
  return field + formatted(" = %.17g replayed, %.17g logged", replayed, logged);
}

std::optional<std::string> difference(const CArmCommand& replayed, const CArmCommand& logged) {
  if (auto d = differenceInName(replayed, logged)) return d;
  for (int i = 0; i < kCArmJointCount; ++i) {
    const std::string field = "joint_velocity[" + std::to_string(i) + "]";
    if (auto d = difference(field, replayed.velocity[i], logged.velocity[i])) return d;
  }
  return std::nullopt;
}

std::optional<std::string> difference(const CatheterCommand& replayed, const CatheterCommand& logged) {
  if (auto d = differenceInName(replayed, logged)) return d;
  if (auto d = difference("insertion_speed", replayed.insertion_speed_m_per_s, logged.insertion_speed_m_per_s))
    return d;
  if (auto d = difference("roll_speed", replayed.roll_speed_rad_per_s, logged.roll_speed_rad_per_s)) return d;
  return difference("bend_speed", replayed.bend_speed_rad_per_s, logged.bend_speed_rad_per_s);
}

}  // namespace angio::servo

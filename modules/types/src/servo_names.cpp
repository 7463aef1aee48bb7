// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/types/servo_status.hpp"

namespace angio::types {
namespace {

template <typename Enum, int N>
const char* nameOf(Enum value, const char* const (&names)[N]) {
  const int index = static_cast<int>(value);
  return index >= 0 && index < N ? names[index] : "unknown";
}

}  // namespace

const char* nameOf(ServoState state) {
  static constexpr const char* kNames[kServoStateCount] = {"hold", "servo", "idle", "armed", "fault", "emergency stop"};
  return nameOf(state, kNames);
}

const char* nameOf(ServoCause cause) {
  static constexpr const char* kNames[kServoCauseCount] = {"none",
                                                           "stop was requested",
                                                           "arming was requested",
                                                           "start was requested",
                                                           "reset was requested",
                                                           "emergency stop was requested",
                                                           "frames are trusted",
                                                           "a frame is in doubt",
                                                           "frames are late",
                                                           "no frame can be used",
                                                           "frames contradict joints and calibration",
                                                           "a clock jumped",
                                                           "joints are not finite",
                                                           "joints are implausible",
                                                           "a joint limit is broken",
                                                           "a joint does not do what was commanded",
                                                           "a second sender"};
  return nameOf(cause, kNames);
}

}  // namespace angio::types

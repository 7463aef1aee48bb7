// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/servo_request_t.hpp>

#include "angio/types/servo_request.hpp"
#include "description.hpp"

namespace angio::messaging::wire {

template <>
struct Description<ServoRequest> : PlainDescription<ServoRequest, angio_lcm::servo_request_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("status_utime", m.status_time_us);
    v.number("transitions", m.transitions, kNotNegative);
    v.number("request", m.request, oneOf(kServoRequestKindCount));
  };

  static std::string line(const ServoRequest& m) {
    static constexpr const char* kNames[kServoRequestKindCount] = {"stop", "arm", "start", "reset", "emergency stop"};
    return kNames[static_cast<int>(m.request)];
  }
};

}  // namespace angio::messaging::wire

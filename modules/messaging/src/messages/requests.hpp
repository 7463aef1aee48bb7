// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/servo_request_t.hpp>
#include <angio_lcm/servo_session_t.hpp>
#include <angio_lcm/view_request_t.hpp>

#include "angio/types/servo_request.hpp"
#include "angio/types/servo_session.hpp"
#include "angio/types/view_request.hpp"
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

template <>
struct Description<ServoSession> : PlainDescription<ServoSession, angio_lcm::servo_session_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("session", m.session);
    v.number("command_sequence", m.command_sequence, kNotNegative);
  };

  static std::string line(const ServoSession& m) {
    return formatted("session %lld, after command %lld", count(m.session), count(m.command_sequence));
  }
};

template <>
struct Description<ViewRequest> : PlainDescription<ViewRequest, angio_lcm::view_request_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us, kUtime);
    v.number("sequence", m.sequence);
    v.number("model_id", m.model_id);
    v.array("beam", m.beam_model);
    v.array("target", m.target_model);
    v.number("within_angle", m.within_rad, kNotNegative);
    v.number("within_distance", m.within_m, kNotNegative);
    v.text("reason", m.reason);
  };

  static std::string line(const ViewRequest& m) {
    return formatted("view %lld along %.2f %.2f %.2f, target %.1f %.1f %.1f mm", count(m.sequence), m.beam_model.x(),
                     m.beam_model.y(), m.beam_model.z(), 1e3 * m.target_model.x(), 1e3 * m.target_model.y(),
                     1e3 * m.target_model.z()) +
           (m.reason.empty() ? "" : ": " + harmless(m.reason));
  }
};

}  // namespace angio::messaging::wire

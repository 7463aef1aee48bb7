// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/catheter_input_t.hpp>
#include <angio_lcm/servo_input_t.hpp>

#include "angio/types/loop_input.hpp"
#include "messages/carm_motion.hpp"
#include "messages/catheter.hpp"
#include "messages/view_request.hpp"

namespace angio::messaging::wire {

template <>
struct Description<ServoInput> : PlainDescription<ServoInput, angio_lcm::servo_input_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("frame_sequence", m.frame_sequence);
    v.number("state_utime", m.state.time_us);
    v.number("state_sequence", m.state.sequence);
    v.array("joint_position", m.state.joints);
    v.array("joint_velocity", m.state.velocity);
    v.number("verdict", m.verdict, oneOf(kServoVerdictCount));
    v.message("view", m.view);
  };

  static std::string line(const ServoInput& m) {
    return verdictText(m.frame_sequence, m.verdict) + jointsText(m.state.joints);
  }
};

template <>
struct Description<CatheterInput> : PlainDescription<CatheterInput, angio_lcm::catheter_input_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("frame_sequence", m.frame_sequence);
    v.number("verdict", m.verdict, oneOf(kServoVerdictCount));
    v.message("arm", m.arm);
    v.message("drive", m.drive);
    v.number("view_reached_utime", m.view_reached_us);
  };

  static std::string line(const CatheterInput& m) {
    return verdictText(m.frame_sequence, m.verdict) + jointsText(m.arm.joints) + ", " +
           Description<CatheterState>::line(m.drive);
  }
};

}  // namespace angio::messaging::wire

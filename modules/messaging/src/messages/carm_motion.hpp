// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <angio_lcm/carm_command_t.hpp>
#include <angio_lcm/carm_state_t.hpp>

#include "angio/types/carm_motion.hpp"
#include "description.hpp"
#include "message_text.hpp"

namespace angio::messaging::wire {

template <>
struct Description<CArmState> : PlainDescription<CArmState, angio_lcm::carm_state_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.array("joint_position", m.joints);
    v.array("joint_velocity", m.velocity);
  };

  static std::string line(const CArmState& m) { return jointsText(m.joints); }
};

template <>
struct Description<CArmCommand> : PlainDescription<CArmCommand, angio_lcm::carm_command_t> {
  static constexpr auto fields = [](auto& v, auto& m) {
    v.number("utime", m.time_us);
    v.number("sequence", m.sequence);
    v.number("frame_sequence", m.frame_sequence);
    v.number("valid_for_us", m.valid_for_us, kNotNegative);
    v.array("joint_velocity", m.velocity);
  };

  static std::string line(const CArmCommand& m) {
    return answerText(m.frame_sequence, m.valid_for_us) + jointsText(m.velocity, "/s");
  }
};

}  // namespace angio::messaging::wire

// SPDX-License-Identifier: GPL-2.0-or-later
// What machines say and are told, and what a loop is given of both.
#include <angio_lcm/carm_command_t.hpp>
#include <angio_lcm/carm_state_t.hpp>
#include <angio_lcm/catheter_command_t.hpp>
#include <angio_lcm/catheter_input_t.hpp>
#include <angio_lcm/catheter_state_t.hpp>

#include "codec_parts.hpp"

namespace angio {

namespace {

angio_lcm::carm_state_t wireOf(const CArmState& state) {
  angio_lcm::carm_state_t wire{};
  wire.utime = state.time_us;
  wire.sequence = state.sequence;
  CArmJoints::Map(wire.joint_position) = state.joints;
  CArmJoints::Map(wire.joint_velocity) = state.velocity;
  return wire;
}

CArmState valueOf(const angio_lcm::carm_state_t& wire) {
  CArmState state;
  state.time_us = wire.utime;
  state.sequence = wire.sequence;
  state.joints = CArmJoints::Map(wire.joint_position);
  state.velocity = CArmJoints::Map(wire.joint_velocity);
  return state;
}

angio_lcm::catheter_state_t wireOf(const CatheterState& state) {
  angio_lcm::catheter_state_t wire{};
  wire.utime = state.time_us;
  wire.sequence = state.sequence;
  wire.insertion = state.insertion_m;
  wire.roll = state.roll_rad;
  wire.bend = state.bend_rad;
  wire.insertion_speed = state.insertion_speed_mps;
  wire.roll_speed = state.roll_speed_radps;
  wire.bend_speed = state.bend_speed_radps;
  wire.insertion_force = state.insertion_force_n;
  return wire;
}

CatheterState valueOf(const angio_lcm::catheter_state_t& wire) {
  CatheterState state;
  state.time_us = wire.utime;
  state.sequence = wire.sequence;
  state.insertion_m = wire.insertion;
  state.roll_rad = wire.roll;
  state.bend_rad = wire.bend;
  state.insertion_speed_mps = wire.insertion_speed;
  state.roll_speed_radps = wire.roll_speed;
  state.bend_speed_radps = wire.bend_speed;
  state.insertion_force_n = wire.insertion_force;
  return state;
}

}  // namespace

std::vector<std::uint8_t> encode(const CArmState& state) {
  codec::requireSound<angio_lcm::carm_state_t>(state);
  return codec::bytesOf(wireOf(state));
}

template <>
Decoded<CArmState> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<CArmState, angio_lcm::carm_state_t>(codec::Tail::kNone, data, size,
                                                             [](const auto& wire) { return valueOf(wire); });
}

std::vector<std::uint8_t> encode(const CArmCommand& command) {
  codec::requireSound<angio_lcm::carm_command_t>(command);
  angio_lcm::carm_command_t wire{};
  wire.utime = command.time_us;
  wire.sequence = command.sequence;
  wire.frame_sequence = command.frame_sequence;
  wire.valid_for_us = command.valid_for_us;
  CArmJoints::Map(wire.joint_velocity) = command.velocity;
  return codec::bytesOf(wire);
}

template <>
Decoded<CArmCommand> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<CArmCommand, angio_lcm::carm_command_t>(codec::Tail::kNone, data, size, [](const auto& wire) {
    CArmCommand command;
    command.time_us = wire.utime;
    command.sequence = wire.sequence;
    command.frame_sequence = wire.frame_sequence;
    command.valid_for_us = wire.valid_for_us;
    command.velocity = CArmJoints::Map(wire.joint_velocity);
    return command;
  });
}

std::vector<std::uint8_t> encode(const CatheterState& state) {
  codec::requireSound<angio_lcm::catheter_state_t>(state);
  return codec::bytesOf(wireOf(state));
}

template <>
Decoded<CatheterState> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<CatheterState, angio_lcm::catheter_state_t>(codec::Tail::kNone, data, size,
                                                                     [](const auto& wire) { return valueOf(wire); });
}

std::vector<std::uint8_t> encode(const CatheterCommand& command) {
  codec::requireSound<angio_lcm::catheter_command_t>(command);
  angio_lcm::catheter_command_t wire{};
  wire.utime = command.time_us;
  wire.sequence = command.sequence;
  wire.frame_sequence = command.frame_sequence;
  wire.valid_for_us = command.valid_for_us;
  wire.insertion_speed = command.insertion_speed_mps;
  wire.roll_speed = command.roll_speed_radps;
  wire.bend_speed = command.bend_speed_radps;
  return codec::bytesOf(wire);
}

template <>
Decoded<CatheterCommand> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<CatheterCommand, angio_lcm::catheter_command_t>(
      codec::Tail::kNone, data, size, [](const auto& wire) {
        CatheterCommand command;
        command.time_us = wire.utime;
        command.sequence = wire.sequence;
        command.frame_sequence = wire.frame_sequence;
        command.valid_for_us = wire.valid_for_us;
        command.insertion_speed_mps = wire.insertion_speed;
        command.roll_speed_radps = wire.roll_speed;
        command.bend_speed_radps = wire.bend_speed;
        return command;
      });
}

std::vector<std::uint8_t> encode(const CatheterInput& input) {
  codec::requireSound<angio_lcm::catheter_input_t>(input);
  angio_lcm::catheter_input_t wire{};
  wire.utime = input.time_us;
  wire.frame_sequence = input.frame_sequence;
  wire.verdict = static_cast<std::int8_t>(input.verdict);
  wire.arm = wireOf(input.arm);
  wire.drive = wireOf(input.drive);
  return codec::bytesOf(wire);
}

template <>
Decoded<CatheterInput> decode(const std::uint8_t* data, std::size_t size) {
  return codec::decodeAs<CatheterInput, angio_lcm::catheter_input_t>(
      codec::Tail::kNone, data, size, [](const auto& wire) {
        CatheterInput input;
        input.time_us = wire.utime;
        input.frame_sequence = wire.frame_sequence;
        input.verdict = static_cast<ServoVerdict>(wire.verdict);
        input.arm = valueOf(wire.arm);
        input.drive = valueOf(wire.drive);
        return input;
      });
}

}  // namespace angio

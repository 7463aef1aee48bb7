// SPDX-License-Identifier: GPL-2.0-or-later
#include "injected_fault.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "angio/base/formatted.hpp"
#include "angio/messaging/channels.hpp"
#include "angio/messaging/codec.hpp"

namespace angio {
namespace {

using Bytes = std::vector<std::uint8_t>;

// No encoder of ours sends a NaN: it is put in place of a number on the wire, where doubles are big-endian.
Bytes withNan(Bytes bytes, double in_place_of) {
  const auto wire = [](double value) {
    Bytes b(8);
    std::memcpy(b.data(), &value, 8);
    std::reverse(b.begin(), b.end());
    return b;
  };
  const Bytes from = wire(in_place_of), to = wire(std::numeric_limits<double>::quiet_NaN());
  const auto at = std::search(bytes.begin(), bytes.end(), from.begin(), from.end());
  if (at != bytes.end()) std::copy(to.begin(), to.end(), at);
  return bytes;
}

}  // namespace

const char* nameOf(FaultKind kind) {
  static const char* const kNames[kFaultKindCount] = {"none",         "loss",          "delay",       "jitter",
                                                      "duplicates",   "reorder",       "stall",       "NaN and units",
                                                      "frozen image", "other patient", "killed node", "clock jump"};
  return kNames[static_cast<int>(kind)];
}

InjectedFault::InjectedFault(FaultKind kind, int seed, double command_latency_ms, SimulatedRoom& room,
                             SimulatedXrayNode& other)
    : kind_(kind),
      engine_(static_cast<std::uint64_t>(seed) ^ 0x6661756c),
      command_latency_ms_(command_latency_ms),
      room_(room),
      other_(other),
      description_(nameOf(kind)) {
  const auto both = [this](double DisturbanceSettings::*field, double value) {
    from_machines_.*field = from_loop_.*field = value;
    description_ += formatted(" %.3g", value);
  };
  switch (kind) {
    case FaultKind::kLoss:
      both(&DisturbanceSettings::loss_probability, uniform(0, 0.5));
      break;
    case FaultKind::kDelay: {
      const int where = static_cast<int>(uniform(1, 4));  // The way there, the way back, or both.
      if (where & 1) from_machines_.delay_ms = uniform(0, 500);
      if (where & 2) from_loop_.delay_ms = uniform(0, 500);
      description_ += formatted(" %.0f ms to the loop, %.0f ms from it", from_machines_.delay_ms, from_loop_.delay_ms);
      break;
    }
    case FaultKind::kJitter:
      both(&DisturbanceSettings::jitter_ms, uniform(0, 500));
      break;
    case FaultKind::kDuplicates:
    case FaultKind::kReorder:
      both(kind == FaultKind::kReorder ? &DisturbanceSettings::reorder_probability
                                       : &DisturbanceSettings::duplicate_probability,
           uniform(0, 0.5));
      from_machines_.reorder_delay_ms = from_loop_.reorder_delay_ms = uniform(10, 500);
      break;
    case FaultKind::kStall:
      from_machines_.stalled = uniform(0, 1) < 0.6;
      from_loop_.stalled = !from_machines_.stalled || uniform(0, 1) < 0.3;
      break;
    case FaultKind::kClockJump:
      clock_jump_s_ = uniform(0.05, 10) * (uniform(0, 1) < 0.5 ? -1 : 1);
      description_ += formatted(" %.2f s", clock_jump_s_);
      break;
    default:
      break;
  }
}

double InjectedFault::uniform(double low, double high) {
  return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
}

void InjectedFault::disturb(const DisturbanceSettings& machines, const DisturbanceSettings& loop) {
  for (const char* channel : {kXrayFrameChannel, kCArmStateChannel}) room_.fromMachines().disturb(channel, machines);
  DisturbanceSettings commands = loop;
  commands.delay_ms += command_latency_ms_;
  room_.fromLoop().disturb(kCArmCommandChannel, commands);
  room_.fromLoop().disturb(kServoStatusChannel, loop);
}

void InjectedFault::begin() {
  lasts_ = true;
  disturb(from_machines_, from_loop_);
}

void InjectedFault::end() {
  lasts_ = false;
  disturb({}, {});
}

std::optional<std::string> InjectedFault::tamper(XrayFrame& frame) {
  if (lasts_ && kind_ == FaultKind::kFrozenImage && !last_image_.empty()) {
    frame.image = last_image_.clone();
    return "frozen";
  }
  last_image_ = frame.image;
  if (lasts_ && kind_ == FaultKind::kOtherPatient) {
    frame.image = other_.render(frame.time_us, room_.arm().state().joints).image;
    return "another patient's";
  }
  if (lasts_ && kind_ == FaultKind::kClockJump) {
    frame.time_us += std::llround(1e6 * clock_jump_s_);
    return "of a wrong clock";
  }
  return std::nullopt;
}

void InjectedFault::spoil(std::int64_t now_us) {
  if (!lasts_ || kind_ != FaultKind::kNan) return;
  constexpr double kMark = 0.12345678901;
  CArmState state = room_.arm().state();
  state.sequence = 1'000'000 + ++spoilt_;
  state.joints[static_cast<int>(uniform(0, kCArmJointCount))] = kMark;
  room_.fromMachines().publish(kCArmStateChannel, withNan(encode(state), kMark));
  CArmCommand command;
  command.time_us = now_us;
  command.sequence = 1'000'000 + spoilt_;
  command.valid_for_us = 200'000;
  command.velocity[0] = kMark;
  room_.fromLoop().publish(kCArmCommandChannel, withNan(encode(command), kMark));
  command.velocity[0] = uniform(5, 25);  // Degrees a second ...
  room_.fromLoop().publish(kCArmCommandChannel, encode(command));
  if (spoilt_ < 15) return;
  state.joints = room_.arm().state().joints;  // ... and, after a second, millimetres.
  state.joints.tail<3>() *= 1000;
  room_.fromMachines().publish(kCArmStateChannel, encode(state));
}

}  // namespace angio

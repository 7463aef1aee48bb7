// SPDX-License-Identifier: GPL-2.0-or-later
#include "injected_fault.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "angio/base/formatted.hpp"
#include "angio/messaging/codec.hpp"
#include "angio/types/channels.hpp"

namespace angio::experiments {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::int64_t kArmBack_us = 10'000'000;
constexpr std::int64_t kSpoilt = 1'000'000;  // Sequence numbers of what nobody should believe.
constexpr int kFramesOfNan = 15;             // Before wrong units come, too.
constexpr double kMark = 0.12345678901;

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

double& speedOf(CArmCommand& command) { return command.velocity[0]; }
double& speedOf(CatheterCommand& command) { return command.insertion_speed_m_per_s; }

}  // namespace

const char* nameOf(FaultKind kind) {
  static const char* const kNames[kFaultKindCount] = {
      "none",          "loss",         "delay",         "jitter",      "duplicates", "reorder",     "stall",
      "NaN and units", "frozen image", "other patient", "killed node", "clock jump", "late frames", "impossible joints",
      "arm clock back"};
  return kNames[static_cast<int>(kind)];
}

InjectedFault::InjectedFault(FaultKind kind, OperatedMachine machine, int seed, double command_latency_ms,
                             double max_frame_age_s, SimulatedLab& lab, SimulatedXrayNode& other)
    : kind_(kind),
      machine_(machine),
      engine_(static_cast<std::uint64_t>(seed) ^ 0x6661756c),
      command_latency_ms_(command_latency_ms),
      max_frame_age_s_(max_frame_age_s),
      lab_(lab),
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
    case FaultKind::kLateFrames:
      late_ms_ = 1e3 * max_frame_age_s + uniform(25, 200);
      description_ += formatted(" by %.0f ms", late_ms_);
      break;
    case FaultKind::kImpossibleJoints:
      joint_ = static_cast<int>(uniform(0, kCArmJointCount));
      impossible_ = uniform(10, 60);
      description_ += formatted(", joint %d at %.0f", joint_, impossible_);
      break;
    default:
      break;
  }
}

double InjectedFault::uniform(double low, double high) {
  return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
}

void InjectedFault::disturb(const DisturbanceSettings& machines, const DisturbanceSettings& loop) {
  const bool carm = machine_ == OperatedMachine::kCArm;
  for (const char* channel : {kCArmStateChannel, kCatheterStateChannel}) lab_.fromMachines().disturb(channel, machines);
  DisturbanceSettings frames = machines, commands = loop;
  if (lasts_) frames.delay_ms += late_ms_;
  commands.delay_ms += command_latency_ms_;
  lab_.fromMachines().disturb(kXrayFrameChannel, frames);
  lab_.fromLoop().disturb(carm ? kCArmCommandChannel : kCatheterCommandChannel, commands);
  lab_.fromLoop().disturb(carm ? kServoStatusChannel : kCatheterStatusChannel, loop);
}

void InjectedFault::begin() {
  lasts_ = true;
  disturb(from_machines_, from_loop_);
  if (kind_ != FaultKind::kImpossibleJoints && kind_ != FaultKind::kArmClockBack) return;
  lab_.fromMachines().tamper(kCArmStateChannel, [this](Bytes& bytes) {
    CArmState state = *decode<CArmState>(bytes.data(), bytes.size()).value;
    if (kind_ == FaultKind::kArmClockBack) {
      state.time_us -= kArmBack_us;
    } else {
      state.joints[joint_] = impossible_;
    }
    bytes = encode(state);
  });
}

void InjectedFault::end() {
  lasts_ = false;
  disturb({}, {});
  lab_.fromMachines().tamper(kCArmStateChannel, {});
}

std::optional<std::string> InjectedFault::tamper(XrayFrame& frame) {
  if (lasts_ && kind_ == FaultKind::kFrozenImage && !last_image_.empty()) {
    frame.image = last_image_.clone();
    return "frozen";
  }
  last_image_ = frame.image;
  if (lasts_ && kind_ == FaultKind::kOtherPatient) {
    frame.image = other_.render(frame.time_us, lab_.arm().state().joints).image;
    return "another patient's";
  }
  if (lasts_ && kind_ == FaultKind::kClockJump) {
    frame.time_us += std::llround(1e6 * clock_jump_s_);
    if (std::abs(clock_jump_s_) > max_frame_age_s_) return "of a wrong clock";
  }
  if (lasts_ && kind_ == FaultKind::kImpossibleJoints) return "read with impossible joints";
  if (lasts_ && kind_ == FaultKind::kArmClockBack) return "read with joints of a wrong clock";
  return std::nullopt;
}

// NaN first, then a number in wrong units: degrees for radians, or millimetres for metres.
template <typename Command>
void InjectedFault::spoilCommands(const char* channel, std::int64_t now_us) {
  Command command;
  command.time_us = now_us;
  command.sequence = kSpoilt + spoilt_;
  command.valid_for_us = 200'000;
  speedOf(command) = kMark;
  lab_.fromLoop().publish(channel, withNan(encode(command), kMark));
  speedOf(command) = uniform(5, 25);
  lab_.fromLoop().publish(channel, encode(command));
}

void InjectedFault::spoil(std::int64_t now_us) {
  if (!lasts_ || kind_ != FaultKind::kNan) return;
  const bool catheter = machine_ == OperatedMachine::kCatheter, in_wrong_units = ++spoilt_ >= kFramesOfNan;
  CArmState arm = lab_.arm().state();
  arm.sequence = kSpoilt + spoilt_;
  arm.joints[static_cast<int>(uniform(0, kCArmJointCount))] = kMark;
  lab_.fromMachines().publish(kCArmStateChannel, withNan(encode(arm), kMark));
  if (catheter) {
    CatheterState drive = lab_.catheter().state();
    drive.sequence = kSpoilt + spoilt_;
    drive.insertion_m = kMark;
    lab_.fromMachines().publish(kCatheterStateChannel, withNan(encode(drive), kMark));
    drive.insertion_m = 1000 * lab_.catheter().state().insertion_m;
    if (in_wrong_units) lab_.fromMachines().publish(kCatheterStateChannel, encode(drive));
    spoilCommands<CatheterCommand>(kCatheterCommandChannel, now_us);
    return;
  }
  spoilCommands<CArmCommand>(kCArmCommandChannel, now_us);
  if (!in_wrong_units) return;
  arm.joints = lab_.arm().state().joints;
  arm.joints.tail<3>() *= 1000;
  lab_.fromMachines().publish(kCArmStateChannel, encode(arm));
}

}  // namespace angio::experiments

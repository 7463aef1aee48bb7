// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/perception/state_history.hpp"
#include "angio/servo/servo_loop.hpp"
#include "angio/servo/supervised_node.hpp"

namespace angio::servo {

/// Hears a C-arm's joints: the newest for the supervisor, and those at each exposure for the loop. Hears also the view
/// that is asked for.
class CArmStates {
 public:
  explicit CArmStates(Bus& bus)
      : newest_(bus, kCArmStateChannel), history_(bus, kCArmStateChannel), views_(bus, kViewRequestChannel) {}

  bool heard() const { return !history_.empty(); }
  void hear(SafetySupervisor<MotionMonitor>& safety, std::int64_t now_us) {
    if (const auto state = newest_.take()) safety.observe(*state, now_us, newest_.record().sender);
  }
  std::optional<ServoInput> at(std::int64_t time_us, std::int64_t frame_sequence) const {
    const auto state = history_.at(time_us);
    if (!state) return std::nullopt;
    return ServoInput{time_us, frame_sequence, *state, ServoVerdict::kPermitted, views_.peek().value_or(ViewRequest())};
  }
  void forget() { history_.forget(); }
  std::int64_t refused() const { return history_.refused(); }
  std::vector<ChannelRecord> records() const { return {newest_.record()}; }

 private:
  LatestMessage<CArmState> newest_;
  JointHistory history_;
  LatestMessage<ViewRequest> views_;
};

/// The C-arm's loop as SupervisedNode runs it: its monitor, its states and its channels.
template <>
struct NodeTraits<ServoLoop> {
  using Monitor = MotionMonitor;
  using States = CArmStates;
  static constexpr OperatedMachine kMachine = OperatedMachine::kCArm;
  static constexpr const char* kCommandChannel = kCArmCommandChannel;
  static constexpr const char* kInputChannel = kServoInputChannel;
  static constexpr const char* kStatusChannel = kServoStatusChannel;
  static constexpr const char* kSessionChannel = kServoSessionChannel;
  static constexpr const char* kStateChannels[] = {kCArmStateChannel};
  static constexpr const char* kStateSenders[] = {"C-arms"};
  static constexpr const char* kCommands = "C-arm commands";

  static SafetySupervisor<MotionMonitor> safety(const ServoLoop& loop);
  static const CArmState& arm(const ServoInput& input) { return input.state; }
  static void publish(Bus& bus, const ServoLoop& loop, const ServoReport& report, ServoState state);
  static ServoStatus status(const ServoReport& report);
};

/// The C-arm's loop on a bus: hears XRAY_FRAME, CARM_STATE and SERVO_REQUEST, publishes CARM_COMMAND, SERVO_INPUT,
/// SERVO_STATUS, SERVO_SESSION, and REGISTRATION of each frame that was looked at. As its settings say, it hears
/// REGISTRATION, and does not publish it then, and CATHETER_TIP. Made of ServoLoopSettings and a VesselTree.
using ServoNode = SupervisedNode<ServoLoop>;

/// The messages that say what the loop did.
RegistrationMessage registrationMessage(const ServoReport& report);
ServoStatus servoStatus(const ServoReport& report);

}  // namespace angio::servo

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/navigation/catheter_controller.hpp"
#include "angio/perception/state_history.hpp"
#include "angio/servo/supervised_node.hpp"

namespace angio::navigation {

/// Hears the C-arm's joints and the drive: the newest of both for the supervisor, and those at each exposure for the
/// controller. Hears also which view the C-arm's loop has reached.
class CatheterStates {
 public:
  explicit CatheterStates(Bus& bus)
      : newest_arm_(bus, kCArmStateChannel),
        newest_drive_(bus, kCatheterStateChannel),
        arm_(bus, kCArmStateChannel),
        drive_(bus, kCatheterStateChannel),
        carm_loop_(bus, kServoStatusChannel) {}

  bool heard() const { return !arm_.empty(); }
  void hear(SafetySupervisor<DriveMonitor>& safety, std::int64_t now_us) {
    if (const auto arm = newest_arm_.take()) safety.observe(*arm, now_us, newest_arm_.record().sender);
    if (const auto drive = newest_drive_.take()) safety.observe(*drive, now_us, newest_drive_.record().sender);
    if (const auto status = carm_loop_.take(); status && status->view_reached_us != 0) {
      reached_us_ = status->view_reached_us;
    }
  }
  std::optional<CatheterInput> at(std::int64_t time_us, std::int64_t frame_sequence) const {
    const auto arm = arm_.at(time_us);
    if (!arm) return std::nullopt;
    return CatheterInput{
        time_us,    frame_sequence, ServoVerdict::kPermitted, *arm, drive_.at(time_us).value_or(CatheterState()),
        reached_us_};
  }
  void forget() {
    arm_.forget();
    drive_.forget();
  }
  std::int64_t refused() const { return arm_.refused() + drive_.refused(); }
  std::vector<ChannelRecord> records() const { return {newest_arm_.record(), newest_drive_.record()}; }

 private:
  LatestMessage<CArmState> newest_arm_;
  LatestMessage<CatheterState> newest_drive_;
  JointHistory arm_;
  DriveHistory drive_;
  LatestMessage<ServoStatus> carm_loop_;
  std::int64_t reached_us_ = 0;
};

}  // namespace angio::navigation

namespace angio::servo {

/// The catheter's loop as SupervisedNode runs it: its monitor, its states and its channels.
template <>
struct NodeTraits<navigation::CatheterController> {
  using Monitor = navigation::DriveMonitor;
  using States = navigation::CatheterStates;
  static constexpr OperatedMachine kMachine = OperatedMachine::kCatheter;
  static constexpr const char* kCommandChannel = kCatheterCommandChannel;
  static constexpr const char* kInputChannel = kCatheterInputChannel;
  static constexpr const char* kStatusChannel = kCatheterStatusChannel;
  static constexpr const char* kSessionChannel = kCatheterSessionChannel;
  static constexpr const char* kStateChannels[] = {kCArmStateChannel, kCatheterStateChannel};
  static constexpr const char* kStateSenders[] = {"C-arms", "catheter drives"};
  static constexpr const char* kCommands = "catheter commands";

  static SafetySupervisor<navigation::DriveMonitor> safety(const navigation::CatheterController& loop);
  static const CArmState& arm(const CatheterInput& input) { return input.arm; }
  static void publish(Bus& bus, const navigation::CatheterController& loop,
                      const navigation::CatheterControllerReport& report, ServoState state);
  static ServoStatus status(const navigation::CatheterControllerReport& report);
};

}  // namespace angio::servo

namespace angio::navigation {

/// The catheter's controller on a bus: hears XRAY_FRAME, CARM_STATE, CATHETER_STATE and CATHETER_REQUEST, publishes
/// CATHETER_COMMAND, CATHETER_INPUT, CATHETER_TIP, CATHETER_STATUS, CATHETER_SESSION, and REGISTRATION of each frame
/// that was looked at. With `ask_for_views` it hears SERVO_STATUS, and once started it publishes VIEW_REQUEST until the
/// view is reached. Made of what a CatheterController is made of.
using CatheterNode = SupervisedNode<CatheterController>;

}  // namespace angio::navigation

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_node.hpp"

#include "angio/registration/message_conversion.hpp"

namespace angio::navigation {
namespace {

constexpr double kSurelyHere = 0.9;       // Probability of a branch from which on a tip is located.
constexpr double kSeenTipStd_m = 0.5e-3;  // Across the vessel, of a tip that is seen.

CatheterTip tipMessage(const CatheterControllerReport& report, const TreeTopology& map, ModelId model_id) {
  CatheterTip message;
  message.model_id = model_id;
  message.time_us = report.command.time_us;
  message.frame_sequence = report.command.frame_sequence;
  const auto& belief = report.loop.input.belief;
  if (!belief || !isFromFrame(*belief)) {
    message.reason = belief && !belief->why.empty() ? belief->why : report.hold_reason.value_or("the tip is not seen");
    return message;
  }
  const TipPlace& tip = belief->tip;
  const bool branch_sure = tip.probability >= kSurelyHere, place_sure = belief->status == BeliefStatus::kSeen;
  message.status = branch_sure && place_sure ? CatheterTipStatus::kLocated : CatheterTipStatus::kAmbiguous;
  if (!branch_sure || !place_sure) message.reason = place_sure ? "the tip's branch is not sure" : belief->why;
  message.tip_model = tip.tip_model;
  const Eigen::Matrix3d along = tip.direction_model * tip.direction_model.transpose();
  message.covariance =
      tip.std_m * tip.std_m * along + kSeenTipStd_m * kSeenTipStd_m * (Eigen::Matrix3d::Identity() - along);
  message.branch = tip.branch;
  message.tree_point = map.spot({tip.branch, tip.arc_m}).a;
  message.arc_length_m = tip.path_m;
  message.probability = tip.probability;
  return message;
}

}  // namespace

}  // namespace angio::navigation

namespace angio::servo {

SafetySupervisor<navigation::DriveMonitor> NodeTraits<navigation::CatheterController>::safety(
    const navigation::CatheterController& loop) {
  const navigation::CatheterControllerSettings& s = loop.settings();
  return {s.safety, loop.setup().limits, loop.target_model(),
          navigation::DriveMonitor(s.drive, degToRad(s.loop.navigator.max_bend_deg))};
}

void NodeTraits<navigation::CatheterController>::publish(Bus& bus, const navigation::CatheterController& loop,
                                                         const navigation::CatheterControllerReport& report,
                                                         ServoState state) {
  const bool started = state == ServoState::kHold || state == ServoState::kServo;
  if (report.view_request && started) messaging::publish(bus, kViewRequestChannel, *report.view_request);
  if (report.registration) {
    messaging::publish(bus, kRegistrationChannel,
                       registrationMessage(*report.registration, loop.modelId(), report.command.time_us,
                                           report.command.frame_sequence));
  }
  messaging::publish(bus, kCatheterTipChannel, navigation::tipMessage(report, loop.map(), loop.modelId()));
}

ServoStatus NodeTraits<navigation::CatheterController>::status(const navigation::CatheterControllerReport& report) {
  ServoStatus status;
  status.time_us = report.command.time_us;
  status.frame_sequence = report.command.frame_sequence;
  return status;
}

}  // namespace angio::servo

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_node.hpp"

#include <cmath>
#include <utility>

#include "angio/messaging/channels.hpp"
#include "angio/servo/perception_node.hpp"

namespace angio {
namespace {

constexpr double kSurelyHere = 0.9;   // Probability of a branch from which on a tip is located.
constexpr double kTipStd_m = 0.5e-3;  // Across the vessel, of a tip that is seen.

CatheterNodeSettings checked(const CatheterNodeSettings& settings) {
  checkSettings("catheter node", settings);
  return settings;
}

CatheterTip tipMessage(const CatheterGuideReport& report, const TreeMap& map, ModelId model_id) {
  CatheterTip message;
  message.model_id = model_id;
  message.time_us = report.command.time_us;
  message.frame_sequence = report.command.frame_sequence;
  const auto& belief = report.loop.input.belief;
  if (!belief || belief->status != BeliefStatus::kSeen) {
    message.reason = belief && !belief->why.empty() ? belief->why : report.held.value_or("the tip is not seen");
    return message;
  }
  const TipPlace& tip = belief->tip;
  const bool sure = tip.probability >= kSurelyHere;
  message.status = sure ? CatheterTipStatus::kLocated : CatheterTipStatus::kAmbiguous;
  if (!sure) message.reason = "the tip's branch is not sure";
  message.tip_model = tip.tip_model;
  const Eigen::Matrix3d along = tip.direction_model * tip.direction_model.transpose();
  message.covariance =
      tip.sigma_m * tip.sigma_m * along + kTipStd_m * kTipStd_m * (Eigen::Matrix3d::Identity() - along);
  message.branch = tip.chain;
  message.tree_point = map.spot({tip.chain, tip.arc_m}).a;
  message.arc_length_m = tip.path_m;
  message.probability = tip.probability;
  return message;
}

}  // namespace

CatheterNode::CatheterNode(Bus& bus, const CatheterStage& stage, const VesselTree& tree, const TreePlace& start,
                           const TreePlace& target, const CatheterNodeSettings& settings)
    : bus_(bus),
      settings_(checked(settings)),
      frames_(bus, kXrayFrameChannel),
      drive_(bus, kCatheterStateChannel),
      joints_(bus, kCArmStateChannel),
      requests_(bus, OperatedMachine::kCatheter),
      states_(settings.states),
      freshness_(settings.freshness, stage.limits),
      motion_(settings.drive, degToRad(settings.guide.loop.navigator.largest_bend_deg)),
      guide_(stage, tree, start, target, settings.guide) {}

void CatheterNode::hear(std::int64_t now_us) {
  if (const auto drive = drive_.newest()) {
    if (const auto astray = motion_.measured(*drive)) states_.fault(ServoCause::kMotionDisagrees, *astray, now_us);
  }
  for (const ServoRequest& request : requests_.take()) {
    const ServoState before = states_.state();
    const bool refused = states_.request(request, freshness_.newestFrame_us(), now_us).has_value();
    // A drive that was moved by hand is no fault of what comes next.
    if (before != states_.state() && states_.state() == ServoState::kArmed) motion_.forget();
    if (refused || request.request != ServoRequestKind::kReset) continue;
    freshness_.forget();
    joints_.forget();
    drive_.forget();
    motion_.forget();
  }
  states_.wait(now_us);
}

std::optional<CatheterGuideReport> CatheterNode::answer(std::int64_t now_us) {
  hear(now_us);
  const auto frame = joints_.empty() ? std::nullopt : frames_.take();
  if (!frame) {
    if (states_.transitions() != said_transitions_) say(last_status_);
    return std::nullopt;
  }
  CatheterGuideReport report = answerOf(*frame, *joints_.at(frame->time_us), now_us);
  motion_.commanded(report.command);
  if (report.registration) {
    publish(bus_, kRegistrationChannel,
            registrationMessage(*report.registration, guide_.modelId(), frame->time_us, frame->sequence));
  }
  publish(bus_, kCatheterCommandChannel, report.command);
  publish(bus_, kCatheterTipChannel, tipMessage(report, guide_.map(), guide_.modelId()));
  ServoStatus status;
  status.time_us = frame->time_us;
  status.frame_sequence = frame->sequence;
  say(status);
  return report;
}

// Says on the way what a replay needs to know.
CatheterGuideReport CatheterNode::answerOf(const XrayFrame& frame, const CArmState& arm, std::int64_t now_us) {
  const std::optional<CatheterState> heard = drive_.at(frame.time_us);
  const CatheterState drive = heard.value_or(CatheterState());
  const auto note = [&](ServoVerdict verdict) {
    publish(bus_, kCatheterInputChannel, CatheterInput{frame.time_us, frame.sequence, verdict, arm, drive});
  };
  if (const auto why = objection(frame, arm, heard, now_us)) {
    note(ServoVerdict::kRefused);
    return guide_.refuse(frame, *why);
  }
  CatheterGuideReport report = guide_.step(frame, arm, drive);
  if (report.held) {
    states_.doubted(ServoStateMachine::Doubt::kUnseen, *report.held, now_us);
  } else {
    states_.trusted(now_us);
  }
  const bool may = report.held || states_.moves();
  note(may ? ServoVerdict::kPermitted : ServoVerdict::kTakenBack);
  if (!may) CatheterGuide::takeBack(report, states_.reason());
  return report;
}

// Why a frame must not be used. What is worse than a doubt is a fault, and said here.
std::optional<std::string> CatheterNode::objection(const XrayFrame& frame, const CArmState& arm,
                                                   const std::optional<CatheterState>& drive, std::int64_t now_us) {
  const auto wrong = freshness_.objection(frame, now_us);
  if (wrong && wrong->cause != ServoCause::kFrameDoubted) {
    states_.fault(wrong->cause, wrong->reason, now_us);
    return wrong->reason;
  }
  auto why = wrong ? std::optional(wrong->reason) : guide_.objection(frame, arm);
  const auto age_us = drive ? std::abs(static_cast<double>(frame.time_us - drive->time_us)) : 0.0;
  if (!why && !drive) why = "the drive has not been heard";
  if (!why && age_us > 1e3 * settings_.most_drive_age_ms) why = "the drive's state is not of the frame's time";
  if (why) states_.doubted(ServoStateMachine::Doubt::kUnseen, *why, now_us);
  return why;
}

void CatheterNode::say(ServoStatus status) {
  states_.describe(status);
  publish(bus_, kCatheterStatusChannel, status);
  said_transitions_ = status.transitions;
  last_status_ = std::move(status);
}

}  // namespace angio

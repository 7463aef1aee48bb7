// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_node.hpp"

#include <algorithm>
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

// Stands still, and says which frame it answers.
CatheterCommand atRest(const XrayFrame& frame) {
  CatheterCommand command;
  command.time_us = frame.time_us;
  command.frame_sequence = frame.sequence;
  command.valid_for_us = 1;
  return command;
}

bool finite(const CatheterCommand& command) {
  return std::isfinite(command.insertion_speed_mps) && std::isfinite(command.roll_speed_radps) &&
         std::isfinite(command.bend_speed_radps);
}

CatheterTip tipMessage(const CatheterNodeReport& report, const TreeMap& map, ModelId model_id) {
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
      stage_(stage),
      centroid_(tree.centroid()),
      frames_(bus, kXrayFrameChannel),
      drive_(bus, kCatheterStateChannel),
      joints_(bus, kCArmStateChannel),
      requests_(bus, OperatedMachine::kCatheter),
      perception_(settings.perception, stage.carm, stage.T_dsa_cb, tree),
      gates_(settings.supervisor, stage.limits, tree.centroid()),
      states_(settings.states),
      freshness_(settings.freshness, stage.limits),
      motion_(settings.drive, degToRad(settings.loop.navigator.largest_bend_deg)),
      loop_(tree, start, target, settings.loop) {}

void CatheterNode::hear(std::int64_t now_us) {
  if (const auto& drive = drive_.peek()) {
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
    motion_.forget();
  }
  states_.wait(now_us);
}

std::optional<CatheterNodeReport> CatheterNode::answer(std::int64_t now_us) {
  hear(now_us);
  const auto frame = joints_.empty() ? std::nullopt : frames_.take();
  if (!frame) {
    if (states_.transitions() != said_transitions_) say(last_status_);
    return std::nullopt;
  }
  CatheterNodeReport report = answerOf(*frame, *joints_.at(frame->time_us), now_us);
  report.command.sequence = ++sequence_;
  motion_.commanded(report.command);
  publish(bus_, kCatheterCommandChannel, report.command);
  publish(bus_, kCatheterTipChannel, tipMessage(report, loop_.navigator().map(), perception_.modelId()));
  ServoStatus status;
  status.time_us = frame->time_us;
  status.frame_sequence = frame->sequence;
  say(status);
  return report;
}

CatheterNodeReport CatheterNode::answerOf(const XrayFrame& frame, const CArmState& arm, std::int64_t now_us) {
  CatheterNodeReport report;
  report.command = atRest(frame);
  report.held = objection(frame, arm, now_us);
  if (report.held) return report;
  if (roadmap_ && armHasMoved(arm)) {
    roadmap_.reset();
    believed_ = unseen_ = 0;
    washed_out_ = false;
  }
  if (washed_out_) {
    navigate(frame, arm, report);
  } else {
    lookForVessels(frame, arm, report);
  }
  if (report.held) {
    states_.doubted(ServoStateMachine::Doubt::kUnseen, *report.held, now_us);
  } else {
    states_.trusted(now_us);
    if (!states_.moves()) report.held = states_.reason();
  }
  const CatheterCommand& wanted = report.loop.answer.command;
  if (!report.held && !finite(wanted)) report.held = "the command is not a number";
  if (!report.held) report.command = wanted;
  return report;
}

// Why a frame must not be used. What is worse than a doubt is a fault, and said here.
std::optional<std::string> CatheterNode::objection(const XrayFrame& frame, const CArmState& arm, std::int64_t now_us) {
  const auto wrong = freshness_.objection(frame, now_us);
  if (wrong && wrong->cause != ServoCause::kFrameDoubted) {
    states_.fault(wrong->cause, wrong->reason, now_us);
    return wrong->reason;
  }
  auto why = wrong ? std::optional(wrong->reason) : gates_.objection(frame, arm);
  const auto& drive = drive_.peek();
  const auto age_us = drive ? std::abs(static_cast<double>(frame.time_us - drive->time_us)) : 0.0;
  if (!why && !drive) why = "the drive has not been heard";
  if (!why && age_us > 1e3 * settings_.most_drive_age_ms) why = "the drive's state is not of the frame's time";
  if (why) states_.doubted(ServoStateMachine::Doubt::kUnseen, *why, now_us);
  return why;
}

bool CatheterNode::armHasMoved(const CArmState& arm) const {
  const CArmJoints moved = (arm.joints - roadmap_->joints).cwiseAbs();
  // What is taken to be nearer than it is seems to go further when the table does.
  return moved.head<2>().maxCoeff() > degToRad(settings_.most_turn_deg) ||
         moved.tail<3>().norm() * roadmap_->depth_error > 1e-3 * settings_.most_shift_error_mm;
}

void CatheterNode::lookForVessels(const XrayFrame& frame, const CArmState& arm, CatheterNodeReport& report) {
  report.roadmap = true;
  const Sight sight = perception_.look(frame, arm);
  publish(bus_, kRegistrationChannel,
          registrationMessage(sight.registration, sight.model_id, frame.time_us, frame.sequence));
  const auto doubt = gates_.objection(sight.registration, perception_.calibrated_T_camera_model(arm.joints),
                                      sight.tracked ? std::optional(sight.predicted.T_camera_model) : std::nullopt);
  if (doubt) {
    perception_.doubt();
    // Vessels that have been seen and are seen no more have washed out; ones that never were are still awaited.
    washed_out_ = roadmap_ && ++unseen_ >= settings_.washed_out_frames;
    if (!roadmap_) believed_ = 0;
    report.held = roadmap_ ? "waits for the contrast agent to wash out" : "waits for a roadmap: " + *doubt;
    return;
  }
  perception_.trust(sight, arm);
  unseen_ = 0;
  report.held = "looks at the roadmap";
  if (++believed_ < settings_.roadmap_frames) return;
  const Pose& T = sight.registration.T_camera_model;
  const Matrix6d& covariance = *sight.registration.covariance;  // Believed without one is none.
  Eigen::Matrix<double, 1, 6> J;                                // Of the tree's depth by the pose.
  J << Eigen::RowVector3d::UnitZ(), -skew(T.linear() * centroid_).row(2);
  const double depth_std_m = std::sqrt(std::max(0.0, (J * covariance * J.transpose()).value()));
  roadmap_ = Roadmap{arm.joints, stage_.carm.T_camera_patient(arm.joints).inverse() * T, covariance,
                     depth_std_m / (T * centroid_).z()};
}

void CatheterNode::navigate(const XrayFrame& frame, const CArmState& arm, CatheterNodeReport& report) {
  const SeenPose pose{frame.camera, stage_.carm.T_camera_patient(arm.joints) * roadmap_->T_patient_model,
                      roadmap_->covariance};
  report.loop = loop_.step({frame.time_us, frame.sequence, pose, *drive_.peek()}, loop_.look(frame.image, pose));
  navigation_ = report.loop.answer.state;
  const auto& belief = report.loop.input.belief;
  const bool seen = belief->status == BeliefStatus::kSeen;
  if (!seen) report.held = belief->why.empty() ? "the tip is not seen" : belief->why;
  RegistrationResult here;  // The roadmap, as long as the catheter is found along it.
  here.status = seen ? RegistrationStatus::kConverged : RegistrationStatus::kTooFewPoints;
  here.T_camera_model = pose.T_camera_model;
  here.covariance = pose.covariance;
  publish(bus_, kRegistrationChannel, registrationMessage(here, perception_.modelId(), frame.time_us, frame.sequence));
}

void CatheterNode::say(ServoStatus status) {
  states_.describe(status);
  publish(bus_, kCatheterStatusChannel, status);
  said_transitions_ = status.transitions;
  last_status_ = std::move(status);
}

}  // namespace angio

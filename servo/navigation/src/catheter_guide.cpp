// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_guide.hpp"

#include <algorithm>
#include <cmath>

namespace angio {
namespace {

CatheterGuideSettings checked(const CatheterGuideSettings& settings) {
  checkSettings("catheter guide", settings);
  return settings;
}

bool finite(const CatheterCommand& command) {
  return std::isfinite(command.insertion_speed_mps) && std::isfinite(command.roll_speed_radps) &&
         std::isfinite(command.bend_speed_radps);
}

}  // namespace

CatheterGuide::CatheterGuide(const CatheterStage& stage, const VesselTree& tree, const TreePlace& start,
                             const TreePlace& target, const CatheterGuideSettings& settings)
    : settings_(checked(settings)),
      stage_(stage),
      centroid_(tree.centroid()),
      perception_(settings.perception, stage.carm, stage.T_dsa_cb, tree),
      gates_(settings.supervisor, stage.limits, tree.centroid()),
      loop_(tree, start, target, settings.loop) {}

// Stands still, and says which frame it answers.
CatheterCommand CatheterGuide::atRest(const XrayFrame& frame) {
  CatheterCommand command;
  command.time_us = frame.time_us;
  command.frame_sequence = frame.sequence;
  command.sequence = ++sequence_;
  command.valid_for_us = 1;
  return command;
}

CatheterGuideReport CatheterGuide::refuse(const XrayFrame& frame, const std::string& why) {
  CatheterGuideReport report;
  report.command = atRest(frame);
  report.held = why;
  return report;
}

void CatheterGuide::takeBack(CatheterGuideReport& answer, const std::string& why) {
  CatheterCommand& command = answer.command;
  command.insertion_speed_mps = command.roll_speed_radps = command.bend_speed_radps = 0;
  command.valid_for_us = 1;
  answer.held = why;
}

CatheterGuideReport CatheterGuide::step(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive) {
  CatheterGuideReport report;
  report.command = atRest(frame);
  if (roadmap_ && armHasMoved(arm)) {
    roadmap_.reset();
    believed_ = unseen_ = 0;
    washed_out_ = false;
  }
  if (washed_out_) {
    navigate(frame, arm, drive, report);
  } else {
    lookForVessels(frame, arm, report);
  }
  CatheterCommand wanted = report.loop.answer.command;
  if (!report.held && !finite(wanted)) report.held = "the command is not a number";
  if (report.held) return report;
  wanted.sequence = report.command.sequence;
  report.command = wanted;
  return report;
}

bool CatheterGuide::armHasMoved(const CArmState& arm) const {
  const CArmJoints moved = (arm.joints - roadmap_->joints).cwiseAbs();
  // What is taken to be nearer than it is seems to go further when the table does.
  return moved.head<2>().maxCoeff() > degToRad(settings_.most_turn_deg) ||
         moved.tail<3>().norm() * roadmap_->depth_error > 1e-3 * settings_.most_shift_error_mm;
}

void CatheterGuide::lookForVessels(const XrayFrame& frame, const CArmState& arm, CatheterGuideReport& report) {
  report.roadmap = true;
  const Sight sight = perception_.look(frame, arm);
  report.registration = sight.registration;
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

void CatheterGuide::navigate(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive,
                             CatheterGuideReport& report) {
  const SeenPose pose{frame.camera, stage_.carm.T_camera_patient(arm.joints) * roadmap_->T_patient_model,
                      roadmap_->covariance};
  report.loop = loop_.step({frame.time_us, frame.sequence, pose, drive}, loop_.look(frame.image, pose));
  navigation_ = report.loop.answer.state;
  const auto& belief = report.loop.input.belief;
  const bool seen = belief->status == BeliefStatus::kSeen;
  if (!seen) report.held = belief->why.empty() ? "the tip is not seen" : belief->why;
  RegistrationResult here;  // The roadmap, as long as the catheter is found along it.
  here.status = seen ? RegistrationStatus::kConverged : RegistrationStatus::kTooFewPoints;
  here.T_camera_model = pose.T_camera_model;
  here.covariance = pose.covariance;
  report.registration = here;
}

}  // namespace angio

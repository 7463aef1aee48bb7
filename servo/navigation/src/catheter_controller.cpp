// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_controller.hpp"

#include <cmath>

namespace angio {
namespace {

CatheterControllerSettings checked(const CatheterControllerSettings& settings) {
  checkSettings("catheter controller", settings);
  return settings;
}

// A drive that has been heard of numbers its states or knows the time.
bool heardOf(const CatheterState& drive) { return drive.sequence != 0 || drive.time_us != 0; }

}  // namespace

CatheterController::CatheterController(const CArmSetup& setup, const VesselTree& tree, const TreePlace& start,
                                       const TreePlace& target, const CatheterControllerSettings& settings)
    : settings_(checked(settings)),
      setup_(setup),
      centroid_(tree.centroid()),
      perception_(settings.perception, settings.supervisor, setup.carm, setup.T_dsa_cb, tree, centroid_),
      loop_(tree, start, target, settings.loop) {}

// Stands still, and says which frame it answers.
CatheterCommand CatheterController::numbered(const XrayFrame& frame) const {
  CatheterCommand command;
  command.time_us = frame.time_us;
  command.frame_sequence = frame.sequence;
  command.sequence = sequence_ + 1;
  return atRest(command);
}

CatheterControllerReport CatheterController::refuse(const XrayFrame& frame, const std::string& why) {
  CatheterControllerReport report;
  report.command = numbered(frame);
  report.hold_reason = why;
  return report;
}

void CatheterController::withhold(CatheterControllerReport& proposal, const std::string& why) {
  proposal.command = atRest(proposal.command);
  proposal.hold_reason = why;
}

std::optional<std::string> CatheterController::rejection(const XrayFrame& frame, const CatheterInput& input) const {
  if (auto why = perception_.rejection(frame, input.arm)) return why;
  if (!heardOf(input.drive)) return "the drive has not been heard";
  const double age_us = std::abs(static_cast<double>(frame.time_us) - static_cast<double>(input.drive.time_us));
  if (!(age_us <= 1e3 * settings_.most_drive_age_ms)) return "the drive's state is not of the frame's time";
  return std::nullopt;
}

CatheterControllerReport CatheterController::propose(const XrayFrame& frame, const CatheterInput& input,
                                                     const ExternalEstimates&) {
  if (const auto why = rejection(frame, input)) return refuse(frame, *why);
  CatheterControllerReport report;
  report.command = numbered(frame);
  if (roadmap_ && armHasMoved(input.arm)) {
    roadmap_.reset();
    believed_ = unseen_ = 0;
    washed_out_ = false;
  }
  if (washed_out_) {
    navigate(frame, input.arm, input.drive, report);
  } else {
    lookForVessels(frame, input.arm, report);
  }
  CatheterCommand wanted = report.loop.answer.command;
  if (!report.hold_reason && !isFinite(wanted)) report.hold_reason = "the command is not a number";
  if (report.hold_reason) return report;
  wanted.sequence = report.command.sequence;
  report.command = wanted;
  return report;
}

bool CatheterController::armHasMoved(const CArmState& arm) const {
  const CArmJoints moved = (arm.joints - roadmap_->joints).cwiseAbs();
  // What is taken to be nearer than it is seems to go further when the table does.
  return moved.head<2>().maxCoeff() > degToRad(settings_.most_turn_deg) ||
         moved.tail<3>().norm() * roadmap_->depth_error > 1e-3 * settings_.most_shift_error_mm;
}

void CatheterController::lookForVessels(const XrayFrame& frame, const CArmState& arm,
                                        CatheterControllerReport& report) {
  report.roadmap = true;
  const GatedObservation gated = perception_.observe(frame, arm);
  report.registration = gated.observation.registration;
  if (gated.rejection) {
    // Vessels that have been seen and are seen no more have washed out; ones that never were are still awaited.
    washed_out_ = roadmap_ && ++unseen_ >= settings_.washed_out_frames;
    if (!roadmap_) believed_ = 0;
    report.hold_reason =
        roadmap_ ? "waits for the contrast agent to wash out" : "waits for a roadmap: " + *gated.rejection;
    report.contradicts = gated.contradicts();
    return;
  }
  unseen_ = 0;
  report.hold_reason = "looks at the roadmap";
  if (++believed_ < settings_.roadmap_frames) return;
  const PatientObservation& patient = *gated.patient;
  roadmap_ = Roadmap{arm.joints, setup_.carm.T_camera_patient(arm.joints).inverse() * patient.T_camera_model,
                     patient.covariance, patient.depthStd_m(centroid_) / (patient.T_camera_model * centroid_).z()};
}

void CatheterController::navigate(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive,
                                  CatheterControllerReport& report) {
  const SeenPose pose{frame.camera, setup_.carm.T_camera_patient(arm.joints) * roadmap_->T_patient_model,
                      roadmap_->covariance};
  report.loop = loop_.step({frame.time_us, frame.sequence, pose, drive}, loop_.look(frame.image, pose));
  navigation_ = report.loop.answer.state;
  report.patient = PatientObservation{pose.T_camera_model, roadmap_->covariance};
  const auto& belief = report.loop.input.belief;
  const bool seen = belief->status == BeliefStatus::kSeen;
  if (!seen) report.hold_reason = belief->why.empty() ? "the tip is not seen" : belief->why;
  RegistrationResult here;  // The roadmap, as long as the catheter is found along it.
  here.status = seen ? RegistrationStatus::kConverged : RegistrationStatus::kTooFewPoints;
  here.T_camera_model = pose.T_camera_model;
  here.covariance = roadmap_->covariance;
  report.registration = here;
}

}  // namespace angio

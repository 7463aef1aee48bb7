// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/navigation/catheter_controller.hpp"

#include <cmath>

#include "angio/base/checked.hpp"
#include "angio/types/channels.hpp"
#include "angio/types/time_stamp.hpp"

namespace angio::navigation {
namespace {

// A drive that has been heard of numbers its states or knows the time.
bool heardOf(const CatheterState& drive) { return drive.sequence != 0 || drive.time_us != 0; }

}  // namespace

CatheterController::CatheterController(const CArmSetup& setup, const VesselTree& tree, const TreeLocation& start,
                                       const TreeLocation& target, const CatheterControllerSettings& settings)
    : settings_(checked("catheter controller", settings)),
      setup_(setup),
      centroid_(tree.centroid()),
      perception_(
          {settings.perception, settings.supervisor, setup.carm, setup.T_dsa_cb, centroid_, TargetNeed::kAcrossBeam},
          tree),
      loop_(tree, start, target, settings.loop),
      force_limiter_(settings.loop.navigator.max_force_n, 1e-3 * settings.loop.latency_ms) {
  if (!settings.ask_for_views) return;
  planner_.emplace(tree, target, bestViewScene(setup.carm, setup.limits, setup.R_lps_model), settings.view);
}

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

void CatheterController::commit(const CatheterCommand& sent) {
  sequence_ = sent.sequence;
  force_limiter_.commit(sent);
}

void CatheterController::withhold(CatheterControllerReport& proposal, const std::string& why) {
  proposal.command = atRest(proposal.command);
  proposal.hold_reason = why;
}

std::optional<std::string> CatheterController::rejection(const XrayFrame& frame, const CatheterInput& input) const {
  if (auto why = perception_.rejection(frame, input.arm)) return why;
  if (!heardOf(input.drive)) return "the drive has not been heard";
  const double age_us = std::abs(static_cast<double>(frame.time_us) - static_cast<double>(input.drive.time_us));
  if (auto far =
          differentEpochs({kXrayFrameChannel, "", frame.time_us}, {kCatheterStateChannel, "", input.drive.time_us})) {
    return far;
  }
  if (!(age_us <= 1e3 * settings_.max_drive_age_ms)) return "the drive's state is not of the frame's time";
  return std::nullopt;
}

CatheterControllerReport CatheterController::propose(const XrayFrame& frame, const CatheterInput& input,
                                                     const ExternalEstimates&) {
  if (const auto why = rejection(frame, input)) return refuse(frame, *why);
  force_limiter_.observe(input.drive);
  CatheterControllerReport report;
  report.command = numbered(frame);
  if (planner_) {
    planView(frame, input.view_reached_us);
    if (input.view_reached_us != request_->time_us) {
      report.view_request = request_;
      report.hold_reason = "waits for a view: " + request_->reason;
      return report;
    }
  }
  if (roadmap_ && armHasMoved(input.arm)) forgetRoadmap();
  if (washed_out_) {
    navigate(frame, input.arm, input.drive, report);
  } else {
    searchVessels(frame, input.arm, report);
  }
  CatheterCommand wanted = report.loop.answer.command;
  if (!report.hold_reason && !isFinite(wanted)) report.hold_reason = "the command is not a number";
  if (report.hold_reason) return report;
  wanted.sequence = report.command.sequence;
  report.command = force_limiter_.limited(wanted);
  return report;
}

void CatheterController::forgetRoadmap() {
  roadmap_.reset();
  located_frames_ = unseen_frames_ = 0;
  washed_out_ = false;
}

// Requests the next view when the tip has left the present one's stretch, when it leaves doubt, or when it gives no
// roadmap.
void CatheterController::planView(const XrayFrame& frame, std::int64_t reached_us) {
  if (request_ && reached_us != request_->time_us) return;
  if (!view_since_us_) view_since_us_ = frame.time_us;
  const TipPlace& tip = loop_.belief().tip;
  if (const auto view = planner_->next({tip.branch, tip.arc_m}, in_doubt_, loop_.navigator().isLoose())) {
    ask(frame, *view, !request_ ? "the journey begins" : in_doubt_ ? "the last one leaves doubt" : "the tip goes on");
  } else if (!washed_out_ &&
             1e-6 * static_cast<double>(frame.time_us - *view_since_us_) > settings_.roadmap_patience_s) {
    ask(frame, *planned_, "the last one has given no roadmap");
  }
}

void CatheterController::ask(const XrayFrame& frame, const PlannedView& view, const std::string& reason) {
  ViewRequest request;
  request.time_us = frame.time_us;
  request.sequence = request_ ? request_->sequence + 1 : 1;
  request.model_id = modelId();
  request.beam_model = setup_.R_lps_model.transpose() * beamDirection(view.angles);
  request.target_model = view.middle_model;
  request.within_rad = degToRad(settings_.view_within_deg);
  request.within_m = 1e-3 * settings_.view_within_mm;
  request.reason = reason;
  request_ = request;
  planned_ = view;
  view_since_us_.reset();
  in_doubt_ = false;
  forgetRoadmap();
}

bool CatheterController::armHasMoved(const CArmState& arm) const {
  const CArmJoints moved = (arm.joints - roadmap_->joints).cwiseAbs();
  // What is taken to be nearer than it is seems to go further when the table does.
  return moved.head<2>().maxCoeff() > degToRad(settings_.max_turn_deg) ||
         moved.tail<3>().norm() * roadmap_->depth_error > 1e-3 * settings_.max_shift_error_mm;
}

void CatheterController::searchVessels(const XrayFrame& frame, const CArmState& arm, CatheterControllerReport& report) {
  report.roadmap = true;
  const GatedObservation gated = perception_.observe(frame, arm);
  report.registration = gated.observation.registration;
  if (gated.rejection) {
    // Vessels that have been seen and are seen no more have washed out; ones that never were are still awaited.
    washed_out_ = roadmap_ && ++unseen_frames_ >= settings_.washed_out_frames;
    if (!roadmap_) located_frames_ = 0;
    report.hold_reason =
        roadmap_ ? "waits for the contrast agent to wash out" : "waits for a roadmap: " + *gated.rejection;
    report.contradicts = gated.contradicts();
    return;
  }
  unseen_frames_ = 0;
  report.hold_reason = "looks at the roadmap";
  if (++located_frames_ < settings_.roadmap_frames) return;
  const PatientObservation& patient = *gated.patient;
  roadmap_ = Roadmap{arm.joints, setup_.carm.T_camera_patient(arm.joints).inverse() * patient.T_camera_model,
                     patient.covariance, patient.depthStd_m(centroid_) / (patient.T_camera_model * centroid_).z()};
}

void CatheterController::navigate(const XrayFrame& frame, const CArmState& arm, const CatheterState& drive,
                                  CatheterControllerReport& report) {
  const SeenPose pose{frame.camera, setup_.carm.T_camera_patient(arm.joints) * roadmap_->T_patient_model,
                      roadmap_->covariance};
  report.loop = loop_.step({frame.time_us, frame.sequence, pose, drive}, loop_.findCatheter(frame.image, pose));
  navigation_ = report.loop.answer.state;
  in_doubt_ = report.loop.answer.another_view;
  report.patient = PatientObservation{pose.T_camera_model, roadmap_->covariance};
  const auto& belief = report.loop.input.belief;
  const bool seen = isFromFrame(*belief);
  if (!seen) report.hold_reason = belief->why.empty() ? "the tip is not seen" : belief->why;
  RegistrationResult here;  // The roadmap, as long as the catheter is found along it.
  here.status = seen ? RegistrationStatus::kConverged : RegistrationStatus::kTooFewPoints;
  here.T_camera_model = pose.T_camera_model;
  here.covariance = roadmap_->covariance;
  report.registration = here;
}

}  // namespace angio::navigation

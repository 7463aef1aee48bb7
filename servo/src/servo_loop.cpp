// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/servo_loop.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/base/stopwatch.hpp"
#include "angio/geometry/visp.hpp"

namespace angio {
namespace {

// Frames further apart than this do not belong to one motion; a longer step must not allow a harder one.
constexpr double kLongestPeriod_s = 0.2;
constexpr double kFirstPeriod_s = 1.0 / 15;

// What would otherwise hold the arm frame after frame, or steer it by a matrix that is no rotation.
const ServoLoopSettings& checked(const ServoLoopSettings& settings) {
  const std::string place = "servo loop";
  settings.carm.check();
  requireFinite(place, "view.primary_deg", radToDeg(settings.view.angles.primary_rad));
  requireFinite(place, "view.secondary_deg", radToDeg(settings.view.angles.secondary_rad));
  for (const double x : settings.view.target_model) requireFinite(place, "view.target_model", x);
  for (const double x : settings.T_dsa_cb.translation()) requireFinite(place, "T_dsa_cb.translation", x);
  const auto rotation = [&](const char* field, const Eigen::Matrix3d& R) {
    const double defect = rotationDefect(R);
    if (!(defect < 1e-6))
      throw InputError(place, field, "R^T R - I up to " + shown(defect), "must be a rotation matrix");
  };
  rotation("T_dsa_cb.rotation", settings.T_dsa_cb.linear());
  rotation("view.R_lps_model", settings.view.R_lps_model);
  return settings;
}

}  // namespace

IterativePnpSettings ServoLoopSettings::iterativePnpForSearch() {
  IterativePnpSettings settings;
  settings.prior = PriorForm::kCovariance;
  settings.outside_image = OutsideImage::kIgnore;
  settings.last_scale_px = 1.5;
  return settings;
}

IterativePnpSettings ServoLoopSettings::iterativePnpForTracking() {
  IterativePnpSettings settings = iterativePnpForSearch();
  settings.first_scale_px = 6;
  settings.most_iterations = 20;
  return settings;
}

void ServoLoopSettings::useIterativePnp() {
  search = iterativePnpForSearch();
  tracking = iterativePnpForTracking();
  search_starts.count = 12;
  search_starts.rotation_std_deg = 2;
  search_starts.translation_std_mm = 6;
}

ServoLoop::ServoLoop(const ServoLoopSettings& settings, const VesselTree& tree)
    : settings_(checked(settings)),
      extractor_(makeExtractor(settings.extractor)),
      search_(makeRegistration(settings.search, tree)),
      tracking_(makeRegistration(settings.tracking, tree)),
      tracker_(settings.tracker, settings.carm, settings.T_dsa_cb, tree.centroid()),
      law_(makeServoLaw(settings.law)),
      supervisor_(settings.supervisor, settings.limits, settings.view.target_model),
      desired_(desiredPose(settings.view, settings.carm.source_isocentre_distance_m)) {}

ServoReport ServoLoop::step(const XrayFrame& frame, const CArmState& state) {
  const double period_s =
      last_frame_us_ ? std::clamp(1e-6 * (static_cast<double>(frame.time_us) - static_cast<double>(*last_frame_us_)),
                                  0.0, kLongestPeriod_s)
                     : kFirstPeriod_s;
  last_frame_us_ = frame.time_us;
  ServoReport report = answer(frame, state, period_s);
  report.command.time_us = frame.time_us;
  report.command.frame_sequence = frame.sequence;
  report.command.sequence = last_command_.sequence + 1;
  report.command.valid_for_us = supervisor_.commandValidity_us();
  last_command_ = report.command;
  return report;
}

// The command's velocity is zero unless the last line is reached.
ServoReport ServoLoop::answer(const XrayFrame& frame, const CArmState& state, double period_s) {
  ServoReport report;
  if ((report.held = supervisor_.objection(frame, state))) return report;

  Stopwatch stage;
  report.centerline = vesselsToMatch(extractor_->extract(frame.image));
  report.image_s = stage.seconds();

  stage = Stopwatch();
  const PosePrior predicted = tracker_.predict(state.joints);
  report.registration = tracker_.tracking() ? tracking_->align(report.centerline, frame.camera, predicted)
                                            : search_->search(report.centerline, frame.camera, predicted,
                                                              settings_.search_starts);
  report.registration_s = stage.seconds();

  stage = Stopwatch();
  if ((report.held = supervisor_.objection(
           report.registration, settings_.carm.T_camera_patient(state.joints) * settings_.T_dsa_cb,
           tracker_.tracking() ? std::optional(predicted.T_camera_model) : std::nullopt))) {
    tracker_.miss();
    return report;
  }
  tracker_.update(report.registration.T_camera_model, state.joints);
  const Pose T_camera_model = tracker_.predict(state.joints).T_camera_model;
  report.view_error = viewError(T_camera_model, desired_, settings_.view.target_model);
  const auto wanted =
      law_->velocity(toVisp(T_camera_model), toVisp(desired_), toVisp(settings_.carm.eJe(state.joints)));
  if (!wanted) {
    report.held = "the control law is singular";
    return report;
  }
  report.command.velocity = supervisor_.limit(*wanted, last_command_.velocity, state, period_s);
  report.control_s = stage.seconds();
  return report;
}

OpenLoop::OpenLoop(const ServoLoopSettings& settings)
    : settings_(checked(settings)),
      law_(makeServoLaw(settings.law)),
      supervisor_(settings.supervisor, settings.limits, settings.view.target_model) {}

CArmCommand OpenLoop::step(const CArmState& state, double period_s) {
  CArmCommand command;
  command.time_us = state.time_us;
  command.sequence = last_command_.sequence + 1;
  command.valid_for_us = supervisor_.commandValidity_us();
  const Pose believed = settings_.carm.T_camera_patient(state.joints) * settings_.T_dsa_cb;
  const Pose desired = desiredPose(settings_.view, settings_.carm.source_isocentre_distance_m);
  const auto wanted = law_->velocity(toVisp(believed), toVisp(desired), toVisp(settings_.carm.eJe(state.joints)));
  if (wanted) command.velocity = supervisor_.limit(*wanted, last_command_.velocity, state, period_s);
  last_command_ = command;
  return command;
}

}  // namespace angio

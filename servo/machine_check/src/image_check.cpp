// SPDX-License-Identifier: GPL-2.0-or-later
#include "image_check.hpp"

#include <cmath>

#include "angio/base/formatted.hpp"
#include "angio/perception/image_reading.hpp"
#include "observed_machine.hpp"

namespace angio::machine_check {
namespace {

// Of an image's motion: a fit of 0.1 px beside motions of 1.5 px and more, and patients who are not quite still.
constexpr double kMaxRest = 0.35;
constexpr double kMinMotion_px = 0.5;  // What moves the image by less shows nothing.

constexpr const char* kOrientation = "image orientation";
constexpr const char* kAsSeen = "as seen from the source, x right, y down (xray_frame_t)";

// Joints of a wrong sign put the tree somewhere else: it is looked for further off than a loop looks.
PerceptionSettings wide() {
  PerceptionSettings settings;
  settings.tracker.calibration_rotation_std_deg = 4;
  settings.tracker.calibration_translation_std_mm = 15;
  return settings;
}

}  // namespace

ImageCheck::ImageCheck(const MachineCheckSettings& settings, const VesselTree& tree)
    : tree_(tree), carm_(settings.carm), perception_(wide(), settings.carm, settings.T_dsa_cb, tree) {}

std::optional<Eigen::Matrix2Xd> ImageCheck::project(const XrayCamera& camera, const Pose& T_camera_model) const {
  Eigen::Matrix2Xd px(2, tree_.size());
  for (int i = 0; i < tree_.size(); ++i) {
    const auto seen = camera.project(T_camera_model * tree_.points().col(i));
    if (!seen) return std::nullopt;
    px.col(i) = *seen;
  }
  return px;
}

void ImageCheck::observe(const XrayFrame& frame, const CArmState& state) {
  const Observation observation = perception_.observe(frame, state);
  ++now_.frames;
  now_.joints = state.joints;
  now_.camera = frame.camera;
  now_.status = statusName(observation.registration.status);
  if (!observation.registration.reason.empty()) now_.status += ", " + observation.registration.reason;
  if (observation.registration.status == RegistrationStatus::kConverged) {
    const Pose& T = observation.registration.T_camera_model;
    if (const auto px = project(frame.camera, T)) {
      if (now_.converged++ == 0) now_.points_px = Eigen::Matrix2Xd::Zero(2, tree_.size());
      now_.points_px += (*px - now_.points_px) / now_.converged;
      now_.T_camera_model = T;
    }
  }
  if (!orientation_ && complete()) nameReading(frame, observation, state);
}

void ImageCheck::nameReading(const XrayFrame& frame, const Observation& observation, const CArmState& state) {
  if (now_.converged > 0) {
    orientation_ = {kOrientation, CheckVerdict::kPass, formatted("%d of %d frames register", now_.converged, kFrames),
                    kAsSeen};
    return;
  }
  const CameraPlace place = perception_.placeOf(state);
  for (const ImageReading reading : otherReadings(frame.camera)) {
    const Centerline2d read = readAs(reading, observation.centerline, frame.camera);
    const Observation again = perception_.observe({XrayView{read, frame.camera}}, place);
    if (again.registration.status != RegistrationStatus::kConverged) continue;
    orientation_ = {kOrientation, CheckVerdict::kFail, std::string("the image matches when ") + nameOf(reading),
                    kAsSeen};
    return;
  }
  orientation_ = {kOrientation, CheckVerdict::kNotSeen,
                  "no registration: " + now_.status + "; the tree, the calibration or the joints may be wrong",
                  kAsSeen};
}

CheckRow ImageCheck::orientationRow() const {
  return orientation_.value_or(CheckRow{kOrientation, CheckVerdict::kNotSeen, "no frame was looked at", kAsSeen});
}

CheckRow ImageCheck::motionRow(int joint) const {
  CheckRow row{std::string(kJointNames[joint]) + " by the X-ray", CheckVerdict::kNotSeen, "",
               "the image moves as the joint's sign, unit and axis say"};
  const auto notSeen = [&](const std::string& why) {
    row.measured = why;
    return row;
  };
  if (before_.converged == 0) return notSeen("no registration before it moved");
  if (now_.converged == 0) return notSeen("no registration after it moved: " + now_.status);
  const Pose expected =
      carm_.T_camera_patient(now_.joints) * carm_.T_camera_patient(before_.joints).inverse() * before_.T_camera_model;
  const auto from = project(*now_.camera, before_.T_camera_model), to = project(*now_.camera, expected);
  if (!from || !to) return notSeen("the tree is not in front of the source");
  const Eigen::Matrix2Xd moved = *to - *from;
  const double rms_px = std::sqrt(moved.squaredNorm() / tree_.size());
  if (!(rms_px >= kMinMotion_px)) {
    return notSeen("the encoder moved by " + inUnits(joint, now_.joints[joint] - before_.joints[joint]) +
                   formatted(", which is %.2f px", rms_px));
  }
  const MotionShare share = shareOf(now_.points_px - before_.points_px, moved);
  row.verdict = asExpected(share.share) && share.rest <= kMaxRest ? CheckVerdict::kPass : CheckVerdict::kFail;
  row.measured = wordsOf(share) + formatted(" (%.1f px)", rms_px);
  return row;
}

}  // namespace angio::machine_check

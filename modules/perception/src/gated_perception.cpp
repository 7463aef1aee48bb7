// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/gated_perception.hpp"

#include <utility>

namespace angio::perception {
GatedObservation GatedPerception::observe(const XrayFrame& frame, const CArmState& state) {
  const CameraPlace place = perception_.placeOf(state);
  Observation seen = perception_.observe(frame, state);
  const Centerline2d centerline = seen.centerline;
  const XrayView view{centerline, frame.camera};
  GatedObservation result = gated(std::move(seen), &view, place);
  if (!result.rejection) {
    reading_.accept();
  } else {
    if (const auto advice = reading_.advice()) *result.rejection = *advice + "; " + *result.rejection;
    reading_.reject(result.observation, frame.camera, place);
  }
  return result;
}

GatedObservation GatedPerception::observe(const XrayViews& views, const CameraPlace& place) {
  return gated(perception_.observe(views, place), views.size() == 1 ? &views.front() : nullptr, place);
}

GatedObservation GatedPerception::adopt(const RegistrationResult& registration, const CArmState& state) {
  return gated(perception_.adopt(registration, state), nullptr, perception_.placeOf(state));
}

GatedObservation GatedPerception::gated(Observation observation, const XrayView* view, const CameraPlace& place) {
  GatedObservation result{std::move(observation), std::nullopt, std::nullopt};
  const Observation& seen = result.observation;
  const Pose calibrated = perception_.calibrated_T_camera_model(place);
  const std::optional<Pose> predicted = seen.tracked ? std::optional(seen.predicted.T_camera_model) : std::nullopt;
  result.rejection = gate_.contradiction(seen.registration, calibrated, predicted);
  // A tree that is bent far is explained in part by one frame alone, and by several together all the same.
  if (need_ == TargetNeed::kResolvingDepth && view && !gate_.misplaced(seen.registration, calibrated, predicted)) {
    window_.add(seen.registration, *view, {calibrated, prior_}, place);
  }
  if (result.rejection) {
    perception_.reject();
    return result;
  }
  // What is too unsure for the task is still where the patient is, as well as it is known: it is tracked. A wrong focal
  // length makes a tree look bent, so that such frames count there as well.
  perception_.accept(seen, place);
  const double expected_m = (calibrated * target_).z();
  focal_length_.see(place.T_camera_patient.linear().row(2).transpose(),
                    (seen.registration.T_camera_model * target_).z() - expected_m, expected_m);
  const PatientObservation patient{seen.registration.T_camera_model, *seen.registration.covariance,
                                   seen.registration.points};
  result.rejection = gate_.tooUnsure(patient);
  if (!result.rejection) result.patient = patient;
  return result;
}

void GatedPerception::resolveDepth() {
  const auto fit = window_.fit();
  if (!fit) return;
  const RegistrationResult& seen = fit->registration;
  Eigen::Index nearest = 0;
  (tree_.points().colwise() - target_).colwise().squaredNorm().minCoeff(&nearest);
  resolved_ = ResolvedDepth{
      seen.T_camera_model * (target_ + seen.displacements_m.col(nearest)),
      PatientObservation{seen.T_camera_model, *seen.covariance, seen.points}.pointCovariance(target_),
      window_.T_camera_patient(),
      *fit,
  };
}

void GatedPerception::learn() {
  perception_.learn();
  reading_.tryNext(perception_, gate_);
  // It takes as long as several frames: once, where the C-arm stands still after a turn.
  constexpr double kMore_rad = 0.005;
  const double known_rad = resolved_ ? resolved_->fit.turn_rad : 0;
  if (window_.still() && window_.turn_rad() > known_rad + kMore_rad) resolveDepth();
}

}  // namespace angio::perception

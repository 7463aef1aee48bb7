// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/gated_perception.hpp"

#include <utility>

namespace angio::perception {

GatedObservation GatedPerception::observe(const XrayFrame& frame, const CArmState& state) {
  const CameraPlace place = perception_.placeOf(state);
  GatedObservation result = gated(perception_.observe(frame, state), place);
  if (!result.rejection) {
    reading_.accept();
  } else {
    if (const auto advice = reading_.advice()) *result.rejection = *advice + "; " + *result.rejection;
    reading_.reject(result.observation, frame.camera, place);
  }
  return result;
}

GatedObservation GatedPerception::observe(const XrayViews& views, const CameraPlace& place) {
  return gated(perception_.observe(views, place), place);
}

GatedObservation GatedPerception::adopt(const RegistrationResult& registration, const CArmState& state) {
  return gated(perception_.adopt(registration, state), perception_.placeOf(state));
}

GatedObservation GatedPerception::gated(Observation observation, const CameraPlace& place) {
  GatedObservation result{std::move(observation), std::nullopt, std::nullopt};
  const Observation& seen = result.observation;
  const Pose calibrated = perception_.calibrated_T_camera_model(place);
  result.rejection = gate_.contradiction(seen.registration, calibrated,
                                         seen.tracked ? std::optional(seen.predicted.T_camera_model) : std::nullopt);
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
  result.rejection = gate_.tooUnsure(seen.registration);
  if (!result.rejection) {
    result.patient =
        PatientObservation{seen.registration.T_camera_model, *seen.registration.covariance, seen.registration.points};
  }
  return result;
}

}  // namespace angio::perception

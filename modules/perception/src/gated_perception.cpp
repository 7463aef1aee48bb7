// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/gated_perception.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/base/formatted.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::perception {

// Of chi^2 with two degrees of freedom: one frame in 250,000 that is where it should be. So many in a row are no
// chance.
constexpr double kContradicts = 25;
constexpr int kForgets = 3;

namespace {

// Of a point along the beam, what the image's noise does not explain, where pose and deformation were fitted as one.
// A rigid pose that a deformed fit only explains has no spread: its depth is held by the rigid tree.
double sharedVariance_m2(const PatientObservation& patient, const RegistrationResult& seen,
                         const Eigen::Vector3d& p_model) {
  if (!seen.points || !seen.spread || seen.displacements_m.cols() == 0) return 0;
  const auto along = [&](const PatientObservation& of) { return of.pointCovariance(p_model)(2, 2); };
  const double noise_m2 = seen.noise_covariance ? along({seen.T_camera_model, *seen.noise_covariance}) : 0.0;
  return std::max(0.0, along(patient) - noise_m2);
}

}  // namespace

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
  // A tree that is deformed far is explained in part by one frame alone, and by several together all the same.
  if (need_ == TargetNeed::kResolvingDepth && view && !gate_.misplaced(seen.registration, calibrated, predicted)) {
    window_.add(seen.registration, *view, {calibrated, prior_}, place);
  }
  if (result.rejection) {
    perception_.reject();
    return result;
  }
  PatientObservation patient = PatientObservation::of(seen.registration);
  result.rejection = placeByTurn(patient, seen.registration, place);
  // What is too unsure for the task is still where the patient is, as well as it is known: it is tracked. Depth that a
  // turn has told must not wander from frame to frame. A wrong focal length makes a tree look deformed, so that such
  // frames count there as well.
  perception_.accept(patient.T_camera_model, patient.covariance, place,
                     sharedVariance_m2(patient, seen.registration, target_));
  const double expected_m = (calibrated * target_).z();
  focal_length_.see(place.T_camera_patient.linear().row(2).transpose(),
                    (seen.registration.T_camera_model * target_).z() - expected_m, expected_m);
  if (!result.rejection) result.rejection = gate_.tooUnsure(patient);
  if (!result.rejection) result.patient = patient;
  return result;
}

// Where a turn has told the depth, the observation goes by it. Returns why it cannot; nothing when it does, or no turn
// has.
std::optional<std::string> GatedPerception::placeByTurn(PatientObservation& patient, const RegistrationResult& seen,
                                                        const CameraPlace& place) {
  if (resolved_tree_ && resolved_tree_->outdated(place.time_us)) forgetDepth();
  if (!resolved_tree_) return std::nullopt;
  const auto points =
      std::make_shared<ResolvedPoints>(resolved_tree_, seen, place.T_camera_patient, place.time_us, target_);
  const ResolvedTree::Place target = points->at(target_);
  if (target.mismatch > kContradicts) {
    const double off_mm = 1e3 * (seen.T_camera_model * target_ - target.camera).norm();
    if (++contradicted_in_a_row_ >= kForgets) forgetDepth();
    return formatted(
        "the target is not where the frames of a turn had it, by %.1f mm and %.1f standard deviations: its depth is "
        "open",
        off_mm, std::sqrt(target.mismatch));
  }
  contradicted_in_a_row_ = 0;
  patient = resolved_tree_->pose(target_, target, seen, place.T_camera_patient);
  patient.points = points;
  patient.places = points;
  return std::nullopt;
}

void GatedPerception::forgetDepth() {
  resolved_.reset();
  resolved_tree_.reset();
  contradicted_in_a_row_ = 0;
}

void GatedPerception::resolveDepth() {
  const auto fit = window_.fit(tree_);
  if (!fit) return;
  const RegistrationResult& seen = fit->registration;
  resolved_ = ResolvedDepth{
      seen.T_camera_model * (target_ + seen.displacements_m.col(nearestPoint(tree_, target_))),
      PatientObservation::of(seen).pointCovariance(target_),
      window_.T_camera_patient(),
      *fit,
  };
  resolved_tree_.reset();
  if (seen.status == RegistrationStatus::kConverged) {
    resolved_tree_ = std::make_shared<ResolvedTree>(tree_, *fit, window_.T_camera_patient(), window_.time_us());
  }
}

void GatedPerception::learn() {
  perception_.learn();
  reading_.tryNext(perception_, gate_);
  // It takes as long as several frames: once, where the C-arm stands still after a turn.
  constexpr double kMore_rad = 0.005, kEnough_rad = 0.09;
  const double known_rad = resolved_ ? resolved_->fit.turn_rad : 0;
  if (resolved_tree_ && known_rad > kEnough_rad && gate_.sureEnough(resolved_->worstStd_m())) return;
  if (window_.still() && window_.turn_rad() > known_rad + kMore_rad) resolveDepth();
}

}  // namespace angio::perception

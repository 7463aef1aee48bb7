// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/gated_perception.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/base/errors.hpp"
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

std::optional<CatheterRegistration> catheterOf(const PerceptionSettings& settings, const VesselTree& tree) {
  if (!settings.by_catheter) return std::nullopt;
  const auto* method = std::get_if<OrientedKernelSettings>(&settings.search);
  if (!method) {
    throw InputError("perception", "method", methodName(settings.search),
                     "must be oriented_kernel where frames are registered by a catheter");
  }
  return CatheterRegistration(*method, tree, settings.catheter_rounds_at_once);
}

}  // namespace

GatedPerception::GatedPerception(const GatedPerceptionSettings& settings, const VesselTree& tree,
                                 const std::optional<PointOfInterest>& point)
    : carm_(settings.carm),
      target_(settings.target_model.value_or(tree.centroid())),
      perception_(settings.perception, settings.carm, settings.T_dsa_cb, tree, point),
      gate_(settings.gate, target_, settings.need),
      need_(settings.need),
      tree_(tree),
      catheter_(catheterOf(settings.perception, tree)),
      prior_(settings.perception.tracker.calibrationCovariance()) {}

GatedObservation GatedPerception::observe(const XrayFrame& frame, const CArmState& state) {
  const CameraPlace place = perception_.placeOf(state);
  GatedObservation result;
  result.observation = perception_.see(frame, state);
  XrayView view{result.observation.centerline, frame.camera};
  view.image = &frame.image;
  look({view}, place, result);
  if (!result.rejection) {
    reading_.accept();
  } else {
    if (const auto advice = reading_.advice()) *result.rejection = *advice + "; " + *result.rejection;
    reading_.reject(result.observation, frame.camera, place);
  }
  return result;
}

GatedObservation GatedPerception::observe(const XrayViews& views, const CameraPlace& place) {
  GatedObservation result;
  result.observation = perception_.see(views, place);
  look(views, place, result);
  return result;
}

GatedObservation GatedPerception::adopt(const RegistrationResult& registration, const CArmState& state) {
  GatedObservation result;
  result.observation = perception_.adopt(registration, state);
  gate(nullptr, perception_.placeOf(state), result);
  return result;
}

// A search for the whole tree takes many times as long as a registration by the catheter, and finds nothing where that
// is all there is to see: where a run has pinned the catheter and no tree is tracked, it comes first.
void GatedPerception::look(const XrayViews& views, const CameraPlace& place, GatedObservation& result) {
  const XrayView* view = views.size() == 1 ? &views.front() : nullptr;
  std::optional<RegisteredByCatheter> by;
  const auto askCatheter = [&] {
    // All that was found: what is called a device is the catheter's as well.
    const XrayView all{result.observation.curves, view->camera, view->T_view_first, view->collimator_px, view->image};
    by = catheter_->observe(all, perception_.calibrated_T_camera_model(place), place.time_us);
  };
  const bool catheter_first = catheter_ && view && catheter_->pinned() && !result.observation.tracked;
  if (catheter_first) askCatheter();
  if (by && !by->rejection) {
    perception_.reject();
    goByCatheter(std::move(*by), place, result);
    return;
  }
  perception_.registerViews(views, result.observation);
  gate(view, place, result);
  if (!catheter_ || !view || result.observation.registration.status == RegistrationStatus::kConverged) return;
  if (!catheter_first) askCatheter();
  if (by) goByCatheter(std::move(*by), place, result);
}

void GatedPerception::gate(const XrayView* view, const CameraPlace& place, GatedObservation& result) {
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
    return;
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
  if (result.rejection) return;
  result.rejection = gate_.tooUnsure(patient);
  result.too_unsure = result.rejection.has_value();
  if (!result.rejection) result.patient = patient;
}

void GatedPerception::goByCatheter(RegisteredByCatheter by, const CameraPlace& place, GatedObservation& result) {
  by.result.times += result.observation.registration.times;
  result.observation.registration = ofWholeTree(by);
  result.observation.registration_s = by.result.times.total_s;
  result.rejection = by.rejection;
  if (!result.rejection) {
    const Pose calibrated = perception_.calibrated_T_camera_model(place);
    result.rejection = gate_.misplaced(by.result, calibrated, std::nullopt);
  }
  if (!result.rejection) {
    const PatientObservation patient = observationAt(target_, by, tree_);
    result.rejection = gate_.tooUnsure(patient);
    result.too_unsure = result.rejection.has_value();
    if (!result.rejection) result.patient = patient;
  }
  result.by_catheter = std::move(by);
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
  if (catheter_) catheter_->learn();
  reading_.tryNext(perception_, gate_);
  // It takes as long as several frames: once, where the C-arm stands still after a turn.
  constexpr double kMore_rad = 0.005, kEnough_rad = 0.09;
  const double known_rad = resolved_ ? resolved_->fit.turn_rad : 0;
  if (resolved_tree_ && known_rad > kEnough_rad && gate_.sureEnough(resolved_->worstStd_m())) return;
  if (window_.still() && window_.turn_rad() > known_rad + kMore_rad) resolveDepth();
}

}  // namespace angio::perception

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/perception/perception.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "angio/base/stopwatch.hpp"
#include "angio/perception/patient_observation.hpp"
#include "angio/registration/alignment_score.hpp"
#include "angio/registration/result.hpp"
#include "angio/vessel/resample.hpp"
#include "local_offset_estimator.hpp"

namespace angio::perception {
namespace {

// See PerceptionSettings::tracking.
constexpr double kBreathLength = 2;

RegistrationSettings trackingOf(RegistrationSettings settings) {
  if (auto* ours = std::get_if<OrientedKernelSettings>(&settings)) ours->nonrigid.length_mm *= kBreathLength;
  return settings;
}

std::unique_ptr<Registration> deformableOf(const PerceptionSettings& settings, const VesselTree& tree) {
  if (!settings.tracker.follow_motion || !(settings.tracker.max_deformation_mm > 0)) return nullptr;
  RegistrationSettings deformable = trackingOf(settings.tracking);
  if (!setDeformation(deformable, Deformation::kNonrigid)) return nullptr;
  return makeRegistration(deformable, tree);
}

double rms(const Eigen::Matrix3Xd& displacements_m) {
  return std::sqrt(displacements_m.squaredNorm() / static_cast<double>(displacements_m.cols()));
}

// What a deformed tree's displacements are when they are counted from a rigid pose.
Eigen::Matrix3Xd countedFrom(const Pose& T_camera_model, const RegistrationResult& deformed, const VesselTree& tree) {
  const Eigen::Matrix3Xd& points = tree.points();
  const Pose between = T_camera_model.inverse() * deformed.T_camera_model;
  return ((between.linear() * (points + deformed.displacements_m)).colwise() + between.translation()) - points;
}

// Of a point of the tree, along the beam. The result must have a covariance.
double depthVariance_m2(const RegistrationResult& result, const Eigen::Vector3d& p_model) {
  return PatientObservation::of(result).pointCovariance(p_model)(2, 2);
}

// What a deformed fit knows of the tree's points, and less of their depth.
class OpenInDepth final : public PointUncertainty {
 public:
  OpenInDepth(std::shared_ptr<const PointUncertainty> points, double added_m2)
      : points_(std::move(points)), added_m2_(added_m2) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override {
    Eigen::Matrix3d covariance = points_->covarianceAt(p_model);
    covariance(2, 2) += added_m2_;
    return covariance;
  }

 private:
  std::shared_ptr<const PointUncertainty> points_;
  double added_m2_;
};

// A device's line is a vessel's when the tree explains this part of it.
constexpr double kAlongTree = 0.7;

XrayView withCenterline(const Centerline2d& centerline, const XrayView& view) {
  return {centerline, view.camera, view.T_view_first, view.collimator_px, view.image};
}

// The vessels among curves that have branches and kinds, and the devices' lines that lie along the projected tree.
Centerline2d withVesselsAlong(const VesselTree& tree, const XrayView& view, const Centerline2d& curves,
                              const Pose& T_camera_model) {
  const auto size = static_cast<std::size_t>(curves.size());
  std::vector<bool> keep(size, false);
  for (std::size_t first = 0, last = 0; first < size; first = last) {
    while (last < size && curves.branch[last] == curves.branch[first]) ++last;
    const auto begin = static_cast<std::ptrdiff_t>(first), end = static_cast<std::ptrdiff_t>(last);
    bool vessel = curves.kind[first] == CurveKind::kVessel;
    if (!vessel) {
      std::vector<bool> line(size, false);
      std::fill(line.begin() + begin, line.begin() + end, true);
      const Centerline2d alone = pointsWhere(curves, line);
      vessel = alignmentScore(tree, tree.points(), {withCenterline(alone, view)}, T_camera_model).image_explained >=
               kAlongTree;
    }
    std::fill(keep.begin() + begin, keep.begin() + end, vessel);
  }
  return pointsWhere(curves, keep);
}

}  // namespace

IterativePnpSettings PerceptionSettings::iterativePnpForSearch() {
  IterativePnpSettings settings;
  settings.prior = PriorForm::kCovariance;
  settings.outside_image = OutsideImage::kIgnore;
  settings.last_scale_px = 1.5;
  return settings;
}

IterativePnpSettings PerceptionSettings::iterativePnpForTracking() {
  IterativePnpSettings settings = iterativePnpForSearch();
  settings.first_scale_px = 6;
  settings.max_iterations = 20;
  return settings;
}

void PerceptionSettings::useIterativePnp() {
  search = iterativePnpForSearch();
  tracking = iterativePnpForTracking();
  search_starts.count = 12;
  search_starts.rotation_std_deg = 2;
  search_starts.translation_std_mm = 6;
}

Perception::Perception(const PerceptionSettings& settings, const CArmGeometry& carm, const Pose& T_dsa_cb,
                       const VesselTree& tree, const std::optional<PointOfInterest>& place)
    : model_id_(angio::perception::modelId(tree)),
      carm_(carm),
      T_dsa_cb_(T_dsa_cb),
      search_starts_(settings.search_starts),
      max_deformation_m_(1e-3 * settings.tracker.max_deformation_mm),
      extractor_(makeExtractor(settings.extractor)),
      search_(makeRegistration(settings.search, tree)),
      tracking_(makeRegistration(trackingOf(settings.tracking), tree)),
      deformable_(deformableOf(settings, tree)),
      tracker_(settings.tracker, carm, T_dsa_cb, tree.centroid()),
      place_(place) {
  if (!place_) return;
  place_point_ = nearestPoint(tree, place_->model);
  if (place_->near_m > 0) nearby_ = std::make_shared<LocalOffsetEstimator>(tree, *place_);
}

Observation Perception::lookedFor(const CameraPlace& place) const {
  Observation observation;
  observation.model_id = model_id_;
  observation.predicted = tracker_.predict(place);
  observation.tracked = tracker_.tracking();
  return observation;
}

Observation Perception::see(const XrayFrame& frame, const CArmState& state) {
  Observation observation = lookedFor(placeOf(state));
  const Stopwatch stage;
  observation.curves = extractor_->extract(frame.image);
  observation.centerline = vesselsToMatch(observation.curves);
  observation.image_s = stage.seconds();
  return observation;
}

Observation Perception::see(const XrayViews& views, const CameraPlace& place) const {
  Observation observation = lookedFor(place);
  observation.curves = observation.centerline = views.front().centerline;
  return observation;
}

Observation Perception::observe(const XrayFrame& frame, const CArmState& state) {
  Observation observation = see(frame, state);
  XrayView view{observation.centerline, frame.camera};
  view.image = &frame.image;
  registerViews({view}, observation);
  return observation;
}

Observation Perception::observe(const XrayViews& views, const CameraPlace& place) {
  Observation observation = see(views, place);
  registerViews(views, observation);
  return observation;
}

void Perception::registerViews(const XrayViews& views, Observation& observation) {
  const Stopwatch stage;
  const PosePrior& predicted = observation.predicted;
  observation.registration = observation.tracked ? tracking_->align(views, predicted, predicted.T_camera_model)
                                                 : search_->search(views, predicted, search_starts_);
  if (observation.tracked) takeBackVessels(views, observation);
  if (observation.tracked) fitDeformed(views, observation);
  if (observation.tracked) compareAlternatives(views, observation);
  if (place_ && observation.registration.status == RegistrationStatus::kConverged) {
    observation.place = seen(*place_, views.front().camera, observation);
  }
  observation.registration_s = stage.seconds();
}

Observation Perception::adopt(const RegistrationResult& registration, const CArmState& state) const {
  Observation observation = lookedFor(placeOf(state));
  observation.registration = registration;
  return observation;
}

// A single image does not tell an artery that comes in at its border and ends at a wider one from a catheter: those of
// the neck over an aortic arch are as even as tubes. The tree tells them apart where it is tracked, and is asked where
// the other vessels do not suffice. A catheter that lies along the tree lies in a vessel.
void Perception::takeBackVessels(const XrayViews& views, Observation& observation) {
  RegistrationResult& without = observation.registration;
  if (without.status != RegistrationStatus::kAmbiguous || observation.curves.size() == observation.centerline.size()) {
    return;
  }
  Centerline2d vessels = withVesselsAlong(tracking_->tree(), views.front(), observation.curves, without.T_camera_model);
  if (vessels.size() == observation.centerline.size()) return;
  RegistrationResult with =
      tracking_->align({withCenterline(vessels, views.front())}, observation.predicted, without.T_camera_model);
  with.times += without.times;
  if (with.status != RegistrationStatus::kConverged) return;
  without = std::move(with);
  observation.centerline = std::move(vessels);  // The views refer to it: what follows goes by it as well.
}

// A tree that a breath deforms is explained in part by a rigid one, and called ambiguous or deformed. The deformed fit
// decides: another tree, or none, needs a larger deformation than a breath causes. Where tracking has been lost no
// deformed fit is made: a rigid pose has to stand against its alternatives first. What the deformed fit has found is no
// longer open across the beam. Depth is, in one view: as far as either fit says.
void Perception::fitDeformed(const XrayViews& views, Observation& observation) {
  RegistrationResult& rigid = observation.registration;
  const bool seems_deformed = rigid.status == RegistrationStatus::kConverged && seemsDeformed(rigid);
  if (!deformable_ || !rigid.covariance || (rigid.status != RegistrationStatus::kAmbiguous && !seems_deformed)) return;
  const RegistrationResult deformed = deformable_->align(views, observation.predicted, rigid.T_camera_model);
  if (!explained(deformed) || deformed.displacements_m.cols() != deformable_->tree().size() ||
      !(rms(deformed.displacements_m) <= max_deformation_m_)) {
    return;
  }
  const Eigen::Vector3d centroid = deformable_->tree().centroid();
  const double deformed_m2 = depthVariance_m2(deformed, centroid);
  const double open_m2 = std::max(deformed_m2, depthVariance_m2(rigid, centroid));
  if (rigid.noise_covariance) rigid.covariance = rigid.noise_covariance;
  rigid.points.reset();
  (*rigid.covariance)(2, 2) += std::max(0.0, open_m2 - depthVariance_m2(rigid, centroid));
  rigid.noise_covariance.reset();
  rigid.spread.reset();
  // Frames share what is believed of the pose, and must not seem to have found it each anew.
  if (deformed.points) rigid.points = std::make_shared<OpenInDepth>(deformed.points, open_m2 - deformed_m2);
  rigid.displacements_m = countedFrom(rigid.T_camera_model, deformed, deformable_->tree());
  rigid.alignment = deformed.alignment;
  rigid.evidence = deformed.evidence;
  rigid.status = RegistrationStatus::kConverged;
  rigid.reason.clear();
  rigid.nonrigid_iterations = deformed.nonrigid_iterations;
  rigid.times += deformed.times;
}

// Of a dense tree half of the vessels hide behind others, and a fit in one place is called ambiguous for the share that
// it explains alone. A search around the prediction knows the alternatives: without one the fit is accepted, as it is
// where nothing is tracked.
void Perception::compareAlternatives(const XrayViews& views, Observation& observation) {
  RegistrationResult& tracked = observation.registration;
  if (tracked.status != RegistrationStatus::kAmbiguous) return;
  RegistrationResult searched = search_->search(views, observation.predicted, search_starts_);
  searched.times += tracked.times;
  if (searched.status == RegistrationStatus::kConverged) tracked = std::move(searched);
}

PointObservation Perception::seen(const PointOfInterest& place, const XrayCamera& camera,
                                  const Observation& observation) const {
  PointObservation result{observation.registration.T_camera_model, std::nullopt};
  const Eigen::Matrix3Xd& displacements_m = observation.registration.displacements_m;
  // A tree that is seen deformed lies, around a place, as a rigid one that has been shifted.
  if (displacements_m.cols() > place_point_) {
    const Eigen::Vector3d rigid = result.T_camera_model * place.model;
    const Eigen::Vector3d deformed = result.T_camera_model * (place.model + displacements_m.col(place_point_));
    result.T_camera_model.pretranslate(deformed * (rigid.z() / deformed.z()) - rigid);
  }
  if (nearby_) result.image_shift = nearby_->observe(observation.centerline, camera, result.T_camera_model);
  return result;
}

}  // namespace angio::perception

// SPDX-License-Identifier: GPL-2.0-or-later
#include "navigate_sight.hpp"

#include <algorithm>
#include <cmath>

#include "angio/servo/best_view.hpp"

namespace angio {
namespace {

constexpr double kDetector_m = 0.315, kDetectorDistance_m = 1.2, kSourceDistance_m = 0.75;
constexpr double kLookAhead_m = 3e-3;  // Between the places of the way that a view is judged by.
constexpr double kViewStep_deg = 7.5;
constexpr double kBeforeFork_m = 20e-3;
constexpr int kSearchStarts = 64;

// The view that shows the way from its first fork on least foreshortened and least covered by other vessels: before it
// there is nothing to decide.
ViewAngles viewOf(const VesselTree& tree, const TreeMap& map, const TreePlace& target) {
  BestViewSettings settings;
  settings.step_deg = kViewStep_deg;
  settings.most_primary_deg = 45;
  settings.most_secondary_deg = 30;
  const int trunk = map.pathTo(target.chain).front();
  const double from_m = target.chain == trunk ? 0 : std::max(0.0, map.length_m(trunk) - kBeforeFork_m);
  const TreeSpot first = map.spot({trunk, from_m}), last = map.spot(target);
  return bestView(tree, segmentBetween(tree, first.a, last.b), {}, settings).angles;
}

// The middle of the box around the way: what the table brings to the isocentre.
Eigen::Vector3d middleOf(const TreeMap& map, const TreePlace& target) {
  Eigen::AlignedBox3d box;
  for (const int chain : map.pathTo(target.chain)) {
    const double end_m = chain == target.chain ? target.arc_m : map.length_m(chain);
    for (double s = 0; s < end_m; s += kLookAhead_m) box.extend(map.point({chain, s}));
  }
  return box.center();
}

Pose poseOf(const ViewAngles& view, const Eigen::Vector3d& middle_m) {
  Pose T = Pose::Identity();
  T.linear() = viewRotation(view);
  T.translation() = Eigen::Vector3d(0, 0, kSourceDistance_m) - T.linear() * middle_m;
  return T;
}

bool onDetector(const XrayCamera& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera.width_px() && pixel.y() < camera.height_px();
}

Matrix6d calibrationCovariance(const NavigateStudySettings& study) {
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(std::pow(1e-3 * std::max(study.calibration_error_mm, 0.1), 2)),
      Eigen::Vector3d::Constant(std::pow(degToRad(std::max(study.calibration_error_deg, 0.05)), 2));
  return variance.asDiagonal();
}

}  // namespace

NavigateSight::NavigateSight(const VesselTree& tree, const TreeMap& map, const TreePlace& target,
                             const NavigateStudySettings& study, const NavigateParts& parts, std::uint64_t seed)
    : tree_(tree),
      study_(study),
      T_camera_model_(poseOf(viewOf(tree, map, target), middleOf(map, target))),
      pose_{XrayCamera::centred(study.detector_px, study.detector_px, kDetector_m / study.detector_px,
                                kDetectorDistance_m),
            T_camera_model_, Matrix6d::Zero()},
      random_(seed) {
  // What calibration says before anything is seen.
  pose_.T_camera_model =
      drawnPose(T_camera_model_, tree.centroid(), degToRad(study.calibration_error_deg) / std::sqrt(3.0),
                1e-3 * study.calibration_error_mm / std::sqrt(3.0), static_cast<int>(seed), 0);
  pose_.covariance = calibrationCovariance(study);
  if (!study.images) {  // As a registration of it would be.
    pose_.T_camera_model =
        drawnPose(T_camera_model_, tree.centroid(), degToRad(0.05), 0.2e-3, static_cast<int>(seed), 0);
    pose_.covariance = Vector6d(Vector6d::Constant(1e-8)).asDiagonal();
    return;
  }
  SimulatedPatientSettings look = parts.patient;
  look.device.kind = DeviceKind::kNone;
  look.bolus.enabled = false;
  look.fluoroscopy.seed = static_cast<int>(seed % 1'000'000);
  patient_ = std::make_unique<SimulatedPatient>(tree, look);
  extractor_ = makeExtractor(RidgeSettings{});
  tracer_ = std::make_unique<CatheterTracer>(patient_->tree(), parts.tracer);
  registration_ = makeRegistration(OrientedKernelSettings{}, tree);
}

NavigateSight::~NavigateSight() = default;

// Box-Muller: the standard library's normal distribution differs between machines.
double NavigateSight::normal() {
  const double u = (static_cast<double>(random_() >> 11) + 1) * 0x1p-53,
               v = static_cast<double>(random_() >> 11) * 0x1p-53;
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

std::optional<CatheterTrace> NavigateSight::look(const SimulatedCatheter& catheter, const TipBelief& expected,
                                                 const TipOffset& offset, std::int64_t k, double time_s) {
  return study_.images ? traced(catheter, expected, offset, k, time_s) : projected(catheter);
}

std::optional<CatheterTrace> NavigateSight::projected(const SimulatedCatheter& catheter) {
  const Eigen::Matrix3Xd points = catheter.device(tree_.points()).points;
  CatheterTrace trace;
  SeenCatheter& seen = trace.seen;
  seen.points_px.resize(2, points.cols());
  seen.sigma_px = std::max(study_.noise_px, 0.1);
  Eigen::Index n = 0;
  // Smooth over some points, as an extractor's errors are.
  Eigen::Vector2d error = Eigen::Vector2d::Zero();
  const double keep = 0.8, add = study_.noise_px * std::sqrt(1 - keep * keep);
  const bool outlier = static_cast<double>(random_() >> 11) * 0x1p-53 < study_.outlier_share;
  const Eigen::Vector2d off = outlier ? Eigen::Vector2d(60 * normal(), 60 * normal()) : Eigen::Vector2d::Zero();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    error = (keep * error + add * Eigen::Vector2d(normal(), normal())).eval();
    const auto pixel = pose_.camera.project(T_camera_model_ * points.col(i));
    if (pixel && onDetector(pose_.camera, *pixel)) seen.points_px.col(n++) = *pixel + error + off;
  }
  seen.points_px.conservativeResize(2, n);
  if (n < 2) return std::nullopt;
  return trace;
}

std::optional<CatheterTrace> NavigateSight::traced(const SimulatedCatheter& catheter, const TipBelief& expected,
                                                   const TipOffset& offset, std::int64_t k, double time_s) {
  XrayScene scene = patient_->scene(T_camera_model_, time_s);
  const bool roadmap = !roadmap_at_s_ || time_s - *roadmap_at_s_ >= study_.roadmap_s;
  if (!roadmap) scene.densities = Eigen::VectorXd::Zero(tree_.size());
  const Eigen::Matrix3Xd points =
      scene.displacements_m ? Eigen::Matrix3Xd(tree_.points() + *scene.displacements_m) : tree_.points();
  scene.devices.push_back(catheter.device(points));
  image_ = patient_->render(pose_.camera, scene, static_cast<std::uint64_t>(k));
  if (roadmap) {
    registerRoadmap(vesselsToMatch(extractor_->extract(image_)));
    roadmap_at_s_ = time_s;
    return std::nullopt;
  }
  return tracer_->trace(image_, pose_, expected, offset);
}

// Believes a registration that converged; another leaves what was known.
void NavigateSight::registerRoadmap(const Centerline2d& seen) {
  const PosePrior prior{pose_.T_camera_model, calibrationCovariance(study_)};
  StartSettings starts;
  starts.count = kSearchStarts;
  const RegistrationResult result = registration_->search(seen, pose_.camera, prior, starts);
  if (result.status != RegistrationStatus::kConverged) return;
  pose_.T_camera_model = result.T_camera_model;
  pose_.covariance = result.covariance.value_or(prior.covariance.value());
}

}  // namespace angio

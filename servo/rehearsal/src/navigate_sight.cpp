// SPDX-License-Identifier: GPL-2.0-or-later
#include "navigate_sight.hpp"

#include <algorithm>
#include <cmath>

#include "angio/servo/best_view.hpp"

namespace angio {
namespace {

constexpr double kDetector_m = 0.315, kDetectorDistance_m = 1.2, kSourceDistance_m = 0.75;
constexpr double kTurn_radps = degToRad(20);
constexpr double kRetry_s = 1;  // After a roadmap that could not be registered.
constexpr int kSearchStarts = 64;

Pose poseOf(const PlannedView& view) {
  Pose T = Pose::Identity();
  T.linear() = viewRotation(view.angles);
  T.translation() = Eigen::Vector3d(0, 0, kSourceDistance_m) - T.linear() * view.middle_model;
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

NavigateSight::NavigateSight(const VesselTree& tree, const NavigateStudySettings& study, const NavigateParts& parts,
                             std::uint64_t seed)
    : tree_(tree),
      study_(study),
      seed_(seed),
      pose_{XrayCamera::centred(study.detector_px, study.detector_px, kDetector_m / study.detector_px,
                                kDetectorDistance_m),
            Pose::Identity(), Matrix6d::Zero()},
      random_(seed) {
  if (!study.images) return;
  SimulatedPatientSettings look = parts.patient;
  look.device.kind = DeviceKind::kNone;
  look.bolus.enabled = false;
  look.fluoroscopy.seed = static_cast<int>(seed % 1'000'000);
  patient_ = std::make_unique<SimulatedPatient>(tree, look);
  extractor_ = makeExtractor(RidgeSettings{});
  registration_ = makeRegistration(OrientedKernelSettings{}, tree);
}

BestViewScene NavigateSight::reachable() {
  CArmGeometry carm;
  carm.source_detector_distance_m = kDetectorDistance_m;
  carm.source_isocentre_distance_m = kSourceDistance_m;
  return bestViewScene(carm, CArmLimits::typical(kDetectorDistance_m - kSourceDistance_m), Eigen::Matrix3d::Identity());
}

double NavigateSight::turnTo(const PlannedView& view) {
  const double turned = std::acos(std::clamp(beamDirection(view.angles).dot(beamDirection(view_)), -1.0, 1.0));
  const double takes_s = views_ == 0 ? 0 : turned / kTurn_radps;
  view_ = view.angles;
  T_camera_model_ = poseOf(view);
  // Without images as a registration would have it; with them, what calibration says before anything is seen.
  const double error_deg = study_.images ? study_.calibration_error_deg / std::sqrt(3.0) : 0.05;
  const double error_m = study_.images ? 1e-3 * study_.calibration_error_mm / std::sqrt(3.0) : 0.2e-3;
  pose_.T_camera_model =
      drawnPose(T_camera_model_, tree_.centroid(), degToRad(error_deg), error_m, static_cast<int>(seed_), views_++);
  pose_.covariance = study_.images ? calibrationCovariance(study_) : Vector6d(Vector6d::Constant(1e-8)).asDiagonal();
  registered_ = !study_.images;
  roadmap_at_s_.reset();
  return takes_s;
}

NavigateSight::~NavigateSight() = default;

// Box-Muller: the standard library's normal distribution differs between machines.
double NavigateSight::normal() {
  const double u = (static_cast<double>(random_() >> 11) + 1) * 0x1p-53,
               v = static_cast<double>(random_() >> 11) * 0x1p-53;
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

std::optional<CatheterTrace> NavigateSight::look(const SimulatedCatheter& catheter, CatheterLoop& loop, std::int64_t k,
                                                 double time_s) {
  return study_.images ? traced(catheter, loop, k, time_s) : projected(catheter);
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

std::optional<CatheterTrace> NavigateSight::traced(const SimulatedCatheter& catheter, CatheterLoop& loop,
                                                   std::int64_t k, double time_s) {
  XrayScene scene = patient_->scene(T_camera_model_, time_s);
  const double lasts_s = registered_ ? study_.roadmap_s : std::min(kRetry_s, study_.roadmap_s);
  const bool roadmap = !roadmap_at_s_ || time_s - *roadmap_at_s_ >= lasts_s;
  if (!roadmap) scene.densities = Eigen::VectorXd::Zero(tree_.size());
  scene.devices.push_back(catheter.device(scene.pointsOf(tree_)));
  image_ = patient_->render(pose_.camera, scene, static_cast<std::uint64_t>(k));
  if (roadmap) {
    registerRoadmap(vesselsToMatch(extractor_->extract(image_)));
    roadmap_at_s_ = time_s;
    return std::nullopt;
  }
  return loop.look(image_, pose_);
}

// Believes a registration that converged; another leaves what was known.
void NavigateSight::registerRoadmap(const Centerline2d& seen) {
  const PosePrior prior{pose_.T_camera_model, calibrationCovariance(study_)};
  StartSettings starts;
  starts.count = kSearchStarts;
  const RegistrationResult result = registration_->search(seen, pose_.camera, prior, starts);
  if (result.status != RegistrationStatus::kConverged) return;
  registered_ = true;
  pose_.T_camera_model = result.T_camera_model;
  pose_.covariance = result.covariance.value_or(prior.covariance.value());
}

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#include "navigate_sight.hpp"

#include <algorithm>
#include <cmath>

namespace angio {
namespace {

constexpr double kDetector_m = 0.315, kDetectorDistance_m = 1.2, kSourceDistance_m = 0.75;
constexpr double kLookAhead_m = 3e-3;     // Between the places of the way that a view is judged by.
constexpr double kWidestVessel_m = 3e-3;  // Half of it: how far from the axis a catheter lies.
constexpr int kSearchStarts = 64;

// The view along whose beam as little runs as possible of the way and of what leaves it at its forks: one place that is
// seen along itself is worse than many that are somewhat short.
ViewAngles bestView(const TreeMap& map, const TreePlace& target) {
  std::vector<Eigen::Vector3d> directions;
  for (const int chain : map.pathTo(target.chain)) {
    const double end_m = chain == target.chain ? target.arc_m : map.length_m(chain);
    for (double s = 0; s < end_m; s += kLookAhead_m) directions.push_back(map.frame({chain, s}).along);
    for (const int child : map.children(chain)) directions.push_back(map.leaving(child, kLookAhead_m));
  }
  ViewAngles best;
  double most = -1e300;
  for (int primary = -45; primary <= 45; primary += 15) {
    for (int secondary = -30; secondary <= 30; secondary += 15) {
      const ViewAngles view{degToRad(primary), degToRad(secondary)};
      const Eigen::Vector3d beam = beamDirection(view);
      double sum = 0;
      for (const Eigen::Vector3d& d : directions) sum -= 1 / (0.05 + d.cross(beam).squaredNorm());
      if (sum > most) most = sum, best = view;
    }
  }
  return best;
}

// Points of the way and of the vessels that leave it: where a catheter may be.
Eigen::Matrix3Xd wayPoints(const TreeMap& map, const TreePlace& target) {
  std::vector<int> chains = map.pathTo(target.chain);
  for (const int chain : map.pathTo(target.chain)) {
    chains.insert(chains.end(), map.children(chain).begin(), map.children(chain).end());
  }
  std::vector<Eigen::Vector3d> points;
  for (const int chain : chains) {
    for (double s = 0; s < map.length_m(chain); s += kLookAhead_m) points.push_back(map.point({chain, s}));
  }
  return Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3, static_cast<Eigen::Index>(points.size()));
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
                             const NavigateStudySettings& study, const SimulatedPatientSettings& patient,
                             std::uint64_t seed)
    : tree_(tree),
      study_(study),
      way_(wayPoints(map, target)),
      T_camera_model_(poseOf(bestView(map, target), middleOf(map, target))),
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
  SimulatedPatientSettings look = patient;
  look.device.kind = DeviceKind::kNone;
  look.bolus.enabled = false;
  look.fluoroscopy.seed = static_cast<int>(seed % 1'000'000);
  patient_ = std::make_unique<SimulatedPatient>(tree, look);
  extractor_ = makeExtractor(RidgeSettings{});
  registration_ = makeRegistration(OrientedKernelSettings{}, tree);
}

NavigateSight::~NavigateSight() = default;

// Box-Muller: the standard library's normal distribution differs between machines.
double NavigateSight::normal() {
  const double u = (static_cast<double>(random_() >> 11) + 1) * 0x1p-53,
               v = static_cast<double>(random_() >> 11) * 0x1p-53;
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

std::optional<SeenCatheter> NavigateSight::look(const SimulatedCatheter& catheter, const Eigen::Vector3d& expected_tip,
                                                std::int64_t k, double time_s) {
  return study_.images ? extracted(catheter, expected_tip, k, time_s) : projected(catheter);
}

std::optional<SeenCatheter> NavigateSight::projected(const SimulatedCatheter& catheter) {
  const Eigen::Matrix3Xd points = catheter.device(tree_.points()).points;
  SeenCatheter seen;
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
  return seen;
}

std::optional<SeenCatheter> NavigateSight::extracted(const SimulatedCatheter& catheter,
                                                     const Eigen::Vector3d& expected_tip, std::int64_t k,
                                                     double time_s) {
  XrayScene scene = patient_->scene(T_camera_model_, time_s);
  const bool roadmap = !roadmap_at_s_ || time_s - *roadmap_at_s_ >= study_.roadmap_s;
  if (!roadmap) scene.densities = Eigen::VectorXd::Zero(tree_.size());
  const Eigen::Matrix3Xd points =
      scene.displacements_m ? Eigen::Matrix3Xd(tree_.points() + *scene.displacements_m) : tree_.points();
  scene.devices.push_back(catheter.device(points));
  const Centerline2d curves = extractor_->extract(patient_->render(pose_.camera, scene, static_cast<std::uint64_t>(k)));
  if (roadmap) {
    registerRoadmap(vesselsToMatch(curves));
    roadmap_at_s_ = time_s;
    return std::nullopt;
  }
  std::optional<CatheterHint> hint;
  if (const auto pixel = pose_.camera.project(pose_.T_camera_model * expected_tip)) hint = CatheterHint{*pixel};
  return seenCatheter(onRoadmap(curves), pose_.camera, study_.pieces, hint);
}

// Without contrast agent in them, vessels are not seen: what lies along the roadmap is the catheter, whatever the
// extractor takes it for.
Centerline2d NavigateSight::onRoadmap(const Centerline2d& seen) const {
  std::vector<Eigen::Vector2d> road;
  for (Eigen::Index i = 0; i < way_.cols(); ++i) {
    if (const auto pixel = pose_.camera.project(pose_.T_camera_model * way_.col(i))) road.push_back(*pixel);
  }
  // Half the distance between its points, and what a vessel is wide, at the detector.
  const double within_px = (0.5 * kLookAhead_m + kWidestVessel_m) * pose_.camera.parameters().fx_px / kSourceDistance_m;
  std::vector<bool> near(static_cast<std::size_t>(seen.size()));
  for (int i = 0; i < seen.size(); ++i) {
    near[static_cast<std::size_t>(i)] = std::any_of(road.begin(), road.end(), [&](const Eigen::Vector2d& pixel) {
      return (pixel - seen.points_px.col(i)).squaredNorm() < within_px * within_px;
    });
  }
  Centerline2d device = pointsWhere(seen, near);
  device.kind.assign(static_cast<std::size_t>(device.size()), CurveKind::kDevice);
  return device;
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

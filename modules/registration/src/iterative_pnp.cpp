// SPDX-License-Identifier: GPL-2.0-or-later
#include "iterative_pnp.hpp"

#include "angio/base/stopwatch.hpp"
#include "angio/registration/agreement.hpp"
#include "angio/vessel/resample.hpp"
#include "judgement.hpp"
#include "nonrigid_step.hpp"
#include "rigid_step.hpp"

namespace angio {
namespace {

// A step that moves no projected point by more than this is rest [px].
constexpr double kRestPx = 1e-3;
// The same for the displacements, rms over the points: a fiftieth of what an image's centreline is known to [px].
constexpr double kNonrigidRestPx = 0.01;

// The scale l of section III-C: starts at the largest match distance, halves every few iterations, ends at a floor.
class ScaleSchedule {
 public:
  ScaleSchedule(double first_px, double last_px, int halve_every)
      : scale_px_(std::max(first_px, last_px)), last_px_(last_px), halve_every_(halve_every) {}

  double scale_px() const { return scale_px_; }
  bool atLast() const { return scale_px_ <= last_px_; }
  void nextIteration() {
    if (++at_this_scale_ >= halve_every_) halve();
  }
  // At rest before its iterations are over, a scale has nothing left to do.
  void halve() {
    scale_px_ = std::max(last_px_, scale_px_ / 2);
    at_this_scale_ = 0;
  }

 private:
  double scale_px_, last_px_;
  int halve_every_;
  int at_this_scale_ = 0;
};

// What depends on the frame only.
struct ImageSide {
  explicit ImageSide(Centerline2d seen) : centerline(std::move(seen)), matcher(centerline.points_px) {}

  Centerline2d centerline;
  PointMatcher matcher;
};

class IterativePnp final : public Registration {
 public:
  IterativePnp(const IterativePnpSettings& settings, const VesselTree& tree)
      : settings_(settings),
        given_(tree),
        model_(resampled(tree, settings.spacing_mm * 1e-3, settings.most_points_3d)),
        points_centred_(model_.tree.points().colwise() - model_.tree.centroid()),
        projected_(model_.tree.size()) {
    radius_m_ = std::sqrt(points_centred_.colwise().squaredNorm().maxCoeff());
    if (settings_.deformation == Deformation::kNonrigid) nonrigid_.emplace(model_.tree, settings_);
  }

  using Registration::align;
  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) override;
  const VesselTree& tree() const override { return given_; }

 private:
  void alignRigid(const ImageSide& image, const XrayCamera& camera, const PosePriorTerm& prior, Pose& T_camera_centred,
                  RegistrationResult& result);
  Eigen::Matrix3Xd alignNonrigid(const ImageSide& image, const XrayCamera& camera, RegistrationResult& result);

  // How far a step moves the projection at most, roughly [px].
  double motionPx(const Twist& dx, const XrayCamera& camera, const Pose& T_camera_centred) const {
    const double depth = std::max(1e-3, T_camera_centred.translation().z());
    return camera.parameters().fx_px / depth * (dx.head<3>().norm() + radius_m_ * dx.tail<3>().norm());
  }

  IterativePnpSettings settings_;
  VesselTree given_;
  ResampledTree model_;
  Eigen::Matrix3Xd points_centred_;
  double radius_m_ = 0;
  Projected projected_;
  std::optional<NonrigidStep> nonrigid_;
};

RegistrationResult IterativePnp::align(const XrayViews& views, const PosePrior& prior, const Pose& start) {
  const Centerline2d& given_centerline = views.front().centerline;
  const XrayCamera& camera = views.front().camera;
  const Stopwatch began;
  RegistrationResult result;
  result.T_camera_model = start;
  result.points_3d = model_.tree.size();
  result.points_2d = given_centerline.size();
  if (nonrigid_) result.displacements_m.setZero(3, given_.size());
  if (tooFewPoints(result)) return result;
  const ImageSide image(densified(given_centerline, settings_.spacing_px));
  result.points_2d = image.centerline.size();
  result.times.prepare_s = began.seconds();

  const Eigen::Translation3d to_centre(model_.tree.centroid());
  Pose T_camera_centred = start * to_centre;
  const Stopwatch rigid_began;
  alignRigid(image, camera, priorTerm(settings_, prior, model_.tree.centroid()), T_camera_centred, result);
  result.T_camera_model = T_camera_centred * to_centre.inverse();
  result.times.rigid_s = rigid_began.seconds();

  Eigen::Matrix3Xd points = model_.tree.points();
  if (nonrigid_) {
    const Stopwatch nonrigid_began;
    const Eigen::Matrix3Xd displacements = alignNonrigid(image, camera, result);
    points += displacements;
    for (int i = 0; i < given_.size(); ++i) {
      const auto& place = model_.place_of_original[static_cast<std::size_t>(i)];
      result.displacements_m.col(i) =
          (1 - place.weight) * displacements.col(place.a) + place.weight * displacements.col(place.b);
    }
    result.times.nonrigid_s = nonrigid_began.seconds();
  }
  result.agreement = agreementOf(model_.tree, points, image.centerline, camera, result.T_camera_model);
  judge(result);
  result.times.total_s = began.seconds();
  return result;
}

void IterativePnp::alignRigid(const ImageSide& image, const XrayCamera& camera, const PosePriorTerm& prior,
                              Pose& T_camera_centred, RegistrationResult& result) {
  Pull pull(model_.tree.size());
  LevenbergMarquardt solver;
  std::optional<ScaleSchedule> schedule;
  while (result.rigid_iterations < settings_.most_iterations) {
    projectPoints(points_centred_, camera, T_camera_centred, settings_.outside_image, projected_);
    matchNearest(projected_, image.matcher, pull);
    if (!schedule) {
      const double first = settings_.first_scale_px > 0 ? settings_.first_scale_px : pull.largest_distance_px;
      schedule.emplace(first, settings_.last_scale_px, settings_.halve_every);
    }
    weigh(projected_, image.matcher, image.centerline.branch, settings_, schedule->scale_px(), pull);
    const auto step = solver.step(points_centred_, camera, T_camera_centred, pull, prior);
    T_camera_centred = step.T_camera_centred;
    ++result.rigid_iterations;
    result.last_step_px = motionPx(step.dx, camera, T_camera_centred);
    const bool at_rest = !step.lowered || result.last_step_px < kRestPx;
    if (at_rest && schedule->atLast()) break;
    // L2 and Huber know no scale: only rest ends them.
    if (settings_.kernel != Kernel::kGaussian && at_rest) break;
    at_rest ? schedule->halve() : schedule->nextIteration();
  }
  result.covariance = covarianceOf(normalEquations(points_centred_, camera, T_camera_centred, pull, prior), pull,
                                   T_camera_centred, model_.tree.centroid());
}

Eigen::Matrix3Xd IterativePnp::alignNonrigid(const ImageSide& image, const XrayCamera& camera,
                                             RegistrationResult& result) {
  Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, model_.tree.size());
  Pull pull(model_.tree.size());
  std::optional<ScaleSchedule> schedule;
  while (result.nonrigid_iterations < settings_.nonrigid_iterations) {
    projectPoints(model_.tree.points() + displacements, camera, result.T_camera_model, settings_.outside_image,
                  projected_);
    matchNearest(projected_, image.matcher, pull);
    if (!schedule) {
      const double first =
          settings_.nonrigid_first_scale_px > 0 ? settings_.nonrigid_first_scale_px : pull.largest_distance_px;
      schedule.emplace(first, settings_.last_scale_px, settings_.halve_every);
    }
    weigh(projected_, image.matcher, image.centerline.branch, settings_, schedule->scale_px(), pull);
    const auto solution = nonrigid_->solve(camera, result.T_camera_model, pull, displacements);
    if (!solution) break;
    const double moved_m = std::sqrt((*solution - displacements).colwise().squaredNorm().mean());
    displacements = *solution;
    ++result.nonrigid_iterations;
    const double depth = std::max(1e-3, (result.T_camera_model * model_.tree.centroid()).z());
    result.last_step_px = camera.parameters().fx_px / depth * moved_m;
    if (schedule->atLast() && result.last_step_px < kNonrigidRestPx) break;
    schedule->nextIteration();
  }
  return displacements;
}

}  // namespace

std::unique_ptr<Registration> make(const IterativePnpSettings& settings, const VesselTree& tree) {
  checkSettings(IterativePnpSettings::kName, settings);
  return std::make_unique<IterativePnp>(settings, tree);
}

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#include "methods.hpp"

#include <deque>

#include "angio/base/stopwatch.hpp"
#include "angio/registration/alignment_score.hpp"
#include "angio/vessel/resample.hpp"
#include "densified_views.hpp"
#include "fit_classification.hpp"
#include "nonrigid_step.hpp"
#include "rigid_step.hpp"

namespace angio::registration {
namespace {

// A step that moves no projected point by more than this is rest [px].
constexpr double kRestPx = 1e-3;
// The same for the displacements, rms over the points: a fiftieth of what an image's centreline is known to [px].
constexpr double kNonrigidRestPx = 0.01;

// The scale l of section III-C: starts at the largest match distance, squared as printed, halves every few iterations,
// ends at a floor.
class ScaleSchedule {
 public:
  // The settings' first scale, 0 for that distance.
  ScaleSchedule(double first_px, const IterativePnpSettings& settings)
      : first_px_(first_px),
        last_px_(settings.last_scale_px),
        halve_every_(settings.halve_every),
        as_printed_(settings.schedule == Schedule::kPaper) {}

  double scaleOf(double max_distance_px) {
    const double by_distance = as_printed_ ? max_distance_px * max_distance_px : max_distance_px;
    if (!scale_px_) scale_px_ = std::max(first_px_ > 0 ? first_px_ : by_distance, last_px_);
    return *scale_px_;
  }
  bool atLast() const { return *scale_px_ <= last_px_; }
  void nextIteration() {
    if (++at_this_scale_ >= halve_every_) halve();
  }
  // At rest before its iterations are over, a scale has nothing left to do: the next one begins, but in the paper.
  void atRest() { as_printed_ ? nextIteration() : halve(); }
  void halve() {
    scale_px_ = std::max(last_px_, *scale_px_ / 2);
    at_this_scale_ = 0;
  }

 private:
  std::optional<double> scale_px_;
  double first_px_, last_px_;
  int halve_every_;
  bool as_printed_;
  int at_this_scale_ = 0;
};

// What depends on the frame only: the views with their points put in equal steps.
class Frame {
 public:
  Frame(const XrayViews& given, double spacing_px) : densified_(given, spacing_px) {
    for (const XrayView& view : views()) matchers_.emplace_back(view.centerline.points_px);
  }

  const XrayViews& views() const { return densified_.views(); }
  std::size_t size() const { return views().size(); }
  const PointMatcher& matcher(std::size_t view) const { return matchers_[view]; }
  const std::vector<int>& branch(std::size_t view) const { return views()[view].centerline.branch; }

 private:
  DensifiedViews densified_;
  std::deque<PointMatcher> matchers_;
};

class IterativePnp final : public Registration {
 public:
  IterativePnp(const IterativePnpSettings& settings, const VesselTree& tree)
      : settings_(settings),
        given_(tree),
        model_(resampled(tree, settings.spacing_mm * 1e-3, settings.max_points_3d)),
        points_centered_(model_.tree.points().colwise() - model_.tree.centroid()) {
    radius_m_ = std::sqrt(points_centered_.colwise().squaredNorm().maxCoeff());
    if (settings_.deformation == Deformation::kNonrigid) nonrigid_.emplace(model_.tree, settings_);
  }

  using Registration::align;

  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) override {
    const Stopwatch began;
    RegistrationResult result = resultAt(start, model_.tree.size(), views);
    if (nonrigid_) result.displacements_m.setZero(3, given_.size());
    const PosePriorTerm held = priorTerm(settings_, prior, model_.tree.centroid());
    result.prior = held.source;
    if (tooFewPoints(result)) return result;
    const Frame frame(views, settings_.spacing_px);
    result.points_2d = pointsIn(frame.views());
    result.times.prepare_s = began.seconds();

    const Eigen::Translation3d to_center(model_.tree.centroid());
    Pose T_camera_centered = start * to_center;
    const Stopwatch rigid_began;
    alignRigid(frame, held, T_camera_centered, result);
    result.T_camera_model = T_camera_centered * to_center.inverse();
    result.times.rigid_s = rigid_began.seconds();

    Eigen::Matrix3Xd points = model_.tree.points();
    if (nonrigid_) {
      const Stopwatch nonrigid_began;
      const Eigen::Matrix3Xd displacements = alignNonrigid(frame, result);
      points += displacements;
      result.displacements_m = model_.ofOriginal(displacements);
      result.times.nonrigid_s = nonrigid_began.seconds();
    }
    result.alignment = alignmentScore(model_.tree, points, frame.views(), result.T_camera_model);
    classify(tree(), result);
    result.times.total_s = began.seconds();
    return result;
  }

  const VesselTree& tree() const override { return given_; }

 private:
  void alignRigid(const Frame& frame, const PosePriorTerm& prior, Pose& T_camera_centered, RegistrationResult& result) {
    projected_.assign(frame.size(), Projected(model_.tree.size()));
    pulls_.assign(frame.size(), Pull(model_.tree.size()));
    LevenbergMarquardt solver;
    ScaleSchedule schedule(settings_.first_scale_px, settings_);
    while (result.rigid_iterations < settings_.max_iterations) {
      weighAll(frame, schedule.scaleOf(match(frame, points_centered_, T_camera_centered)));
      const auto step = solver.step(points_centered_, frame.views(), T_camera_centered, pulls_, prior);
      T_camera_centered = step.T_camera_centered;
      ++result.rigid_iterations;
      result.last_step_px = movedAtMost_px(frame.views(), T_camera_centered, step.dx, radius_m_);
      const bool at_rest = !step.lowered || result.last_step_px < kRestPx;
      if (at_rest && schedule.atLast()) break;
      // L2 and Huber know no scale: only rest ends them.
      if (settings_.kernel != Kernel::kGaussian && at_rest) break;
      at_rest ? schedule.atRest() : schedule.nextIteration();
    }
    result.covariance = covarianceOf(normalEquations(points_centered_, frame.views(), T_camera_centered, pulls_, prior),
                                     pulls_, T_camera_centered, model_.tree.centroid());
  }

  Eigen::Matrix3Xd alignNonrigid(const Frame& frame, RegistrationResult& result) {
    Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, model_.tree.size());
    pulls_.assign(frame.size(), Pull(model_.tree.size()));
    DampedNonrigid solver(*nonrigid_);
    ScaleSchedule schedule(settings_.schedule == Schedule::kPaper ? 0 : settings_.nonrigid_first_scale_px, settings_);
    while (result.nonrigid_iterations < settings_.nonrigid_iterations) {
      const Eigen::Matrix3Xd displaced = model_.tree.points() + displacements;
      weighAll(frame, schedule.scaleOf(match(frame, displaced, result.T_camera_model)));
      const auto solution = solver.step(frame.views(), result.T_camera_model, pulls_, displacements);
      if (!solution) {
        if (schedule.atLast()) break;
        schedule.atRest();
        ++result.nonrigid_iterations;
        continue;
      }
      const double moved_m = std::sqrt((*solution - displacements).colwise().squaredNorm().mean());
      displacements = *solution;
      ++result.nonrigid_iterations;
      result.last_step_px = pixelsPerMetre(frame.views(), result.T_camera_model * model_.tree.centroid()) * moved_m;
      if (schedule.atLast() && result.last_step_px < kNonrigidRestPx) break;
      schedule.nextIteration();
    }
    return displacements;
  }

  // Projects the points into every view and matches them there; returns the largest match distance [px].
  double match(const Frame& frame, const Eigen::Matrix3Xd& points, const Pose& T_camera_points) {
    double max_px = 0;
    for (std::size_t v = 0; v < frame.size(); ++v) {
      projectPoints(points, frame.views()[v], T_camera_points, settings_.outside_image, projected_[v]);
      matchNearest(projected_[v], frame.matcher(v), pulls_[v]);
      max_px = std::max(max_px, pulls_[v].max_distance_px);
    }
    return max_px;
  }

  void weighAll(const Frame& frame, double scale_px) {
    for (std::size_t v = 0; v < frame.size(); ++v) {
      weigh(projected_[v], frame.matcher(v), frame.branch(v), settings_, scale_px, pulls_[v]);
    }
  }

  IterativePnpSettings settings_;
  VesselTree given_;
  ResampledTree model_;
  Eigen::Matrix3Xd points_centered_;
  double radius_m_ = 0;
  std::vector<Projected> projected_;  // One for each view.
  std::vector<Pull> pulls_;           // The same.
  std::optional<NonrigidStep> nonrigid_;
};

}  // namespace

std::unique_ptr<Registration> make(const IterativePnpSettings& settings, const VesselTree& tree) {
  return std::make_unique<IterativePnp>(settings, tree);
}

}  // namespace angio::registration

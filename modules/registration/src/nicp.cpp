// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <deque>

#include "angio/base/stopwatch.hpp"
#include "angio/registration/alignment_score.hpp"
#include "angio/vessel/resample.hpp"
#include "densified_views.hpp"
#include "fit_classification.hpp"
#include "methods.hpp"
#include "nearest_covariance.hpp"
#include "ridge_step.hpp"

namespace angio::registration {
namespace {

// Rest: a step that moves no projected point by more than this [px], at the last scale.
constexpr double kNicpRest_px = 1e-3;
// At the scales before it, in standard deviations of the blur: what is left is the next scale's.
constexpr double kNicpCoarseRest = 0.05;
// Steps at each scale; the last one has to come to rest.
constexpr int kNicpCoarseSteps = 12;
constexpr int kNicpLastSteps = 40;
// From coarse to fine: halved from the first scale on, and the last one; that alone when the first is no coarser.
std::vector<double> nicpScales(const NicpSettings& settings) {
  std::vector<double> scales_px;
  for (double scale_px = settings.first_scale_px; scale_px > settings.last_scale_px; scale_px /= 2) {
    scales_px.push_back(scale_px);
  }
  scales_px.push_back(settings.last_scale_px);
  return scales_px;
}

// What depends on the frame only.
class RidgeFrame {
 public:
  RidgeFrame(const XrayViews& given, const std::vector<double>& scales_px)
      : densified_(given, NicpSettings::spacing_px), images_of_scale_(scales_px.size()) {
    for (const XrayView& view : views()) {
      images_.push_back(ridgeImages(view.centerline, NicpSettings::spacing_px, view.camera, scales_px));
      for (std::size_t s = 0; s < scales_px.size(); ++s) images_of_scale_[s].push_back(&images_.back()[s]);
    }
  }
  RidgeFrame(const RidgeFrame&) = delete;
  RidgeFrame& operator=(const RidgeFrame&) = delete;

  const XrayViews& views() const { return densified_.views(); }
  std::size_t scales() const { return images_of_scale_.size(); }
  const std::vector<const RidgeImage*>& images(std::size_t scale) const { return images_of_scale_[scale]; }

 private:
  DensifiedViews densified_;
  std::deque<std::vector<RidgeImage>> images_;  // A deque's elements stay where they are.
  std::vector<std::vector<const RidgeImage*>> images_of_scale_;
};

class Nicp final : public Registration {
 public:
  Nicp(const NicpSettings& settings, const VesselTree& tree)
      : scales_px_(nicpScales(settings)),
        given_(tree),
        model_(resampled(tree, settings.spacing_mm * 1e-3, settings.max_points_3d)),
        points_(weightedPoints(model_.tree)) {
    radius_m_ = std::sqrt(points_.centered.colwise().squaredNorm().maxCoeff());
  }

  using Registration::align;

  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) override {
    const Stopwatch began;
    RegistrationResult result = resultAt(start, model_.tree.size(), views);
    const PosePriorTerm held = givenPrior(prior, model_.tree.centroid());
    result.prior = held.source;
    if (tooFewPoints(result)) return result;
    const RidgeFrame frame(views, scales_px_);
    result.points_2d = pointsIn(frame.views());
    result.times.prepare_s = began.seconds();

    const Stopwatch rigid_began;
    const Eigen::Translation3d to_center(model_.tree.centroid());
    Pose T_camera_centered = start * to_center;
    for (std::size_t scale = 0; scale < frame.scales(); ++scale) climb(frame, scale, held, T_camera_centered, result);
    // The metric is no likelihood.
    result.covariance =
        covarianceByNearest(points_.centered, frame.views(), T_camera_centered, held, model_.tree.centroid());
    result.T_camera_model = T_camera_centered * to_center.inverse();
    result.times.rigid_s = rigid_began.seconds();

    result.alignment = alignmentScore(model_.tree, model_.tree.points(), frame.views(), result.T_camera_model);
    classify(tree(), result);
    result.times.total_s = began.seconds();
    return result;
  }

  const VesselTree& tree() const override { return given_; }

 private:
  // To rest at one scale, or as far as its steps go.
  void climb(const RidgeFrame& frame, std::size_t scale, const PosePriorTerm& prior, Pose& T_camera_centered,
             RegistrationResult& result) const {
    const bool last = scale + 1 == frame.scales();
    const double rest_px = last ? kNicpRest_px : kNicpCoarseRest * scales_px_[scale];
    const bool in_plane = frame.views().size() == 1 && scales_px_[scale] > NicpSettings::in_plane_above_px;
    const RidgeFreedom freedom = in_plane ? RidgeFreedom::kInPlane : RidgeFreedom::kAll;
    RidgeAscent solver;
    for (int k = 0; k < (last ? kNicpLastSteps : kNicpCoarseSteps); ++k) {
      const auto step = solver.step(points_, frame.views(), frame.images(scale), T_camera_centered, prior, freedom);
      T_camera_centered = step.T_camera_centered;
      ++result.rigid_iterations;
      result.last_step_px = movedAtMost_px(frame.views(), T_camera_centered, step.dx, radius_m_);
      if (!step.lowered || result.last_step_px < rest_px) break;
    }
  }

  std::vector<double> scales_px_;
  VesselTree given_;
  ResampledTree model_;
  WeightedPoints points_;
  double radius_m_ = 0;
};

}  // namespace

std::unique_ptr<Registration> make(const NicpSettings& settings, const VesselTree& tree) {
  return std::make_unique<Nicp>(settings, tree);
}

}  // namespace angio::registration

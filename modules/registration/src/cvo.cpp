// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/base/stopwatch.hpp"
#include "angio/registration/alignment_score.hpp"
#include "angio/vessel/resample.hpp"
#include "densified_views.hpp"
#include "fit_classification.hpp"
#include "kernel_flow.hpp"
#include "methods.hpp"

namespace angio::registration {
namespace {

// A step that moves the projected points by less than this share of the scale, rms, ends the scale; and at the last
// scale one that moves them by less than this many pixels.
constexpr double kRestShare = 0.05, kLastRest_px = 1e-3;
// The last scale may take more steps: the depth of a tree is the last thing that a flow finds.
constexpr int kMaxSteps = 20, kMaxLastSteps = 200;

// Pieces of the tree for each scale: this long, and twice, ... as long.
constexpr double kFinestPiece_m = 0.5e-3;
constexpr int kPieceLengths = 6;
// Pieces are no longer than this share of the scale, in the image, where there are such.
constexpr double kPieceOfScale = 0.5;

class Cvo final : public Registration {
 public:
  Cvo(const CvoSettings& settings, const VesselTree& tree)
      : settings_(settings),
        given_(tree),
        scored_(resampled(tree, settings.spacing_mm * 1e-3, settings.max_points_3d).tree) {
    double piece_m = std::max(kFinestPiece_m, tree.length() / settings.max_points_3d);
    for (int k = 0; k < kPieceLengths; ++k, piece_m *= 2) levels_.push_back({piece_m, modelSamples(tree, piece_m)});
  }

  using Registration::align;

  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) override {
    const Stopwatch began;
    RegistrationResult result = resultAt(start, scored_.size(), views);
    const PosePriorTerm held = givenPrior(prior, given_.centroid());
    result.prior = held.source;
    if (tooFewPoints(result)) return result;

    const Eigen::Translation3d to_center(given_.centroid());
    KernelFlow flow(views, held, start * to_center, settings_.spacing_mm * 1e-3);
    const Stopwatch rigid_began;
    follow(views, flow, result);
    result.T_camera_model = flow.pose() * to_center.inverse();
    result.times.rigid_s = rigid_began.seconds();

    score(views, result);
    classify(given_, result);
    result.times.total_s = began.seconds();
    return result;
  }

  const VesselTree& tree() const override { return given_; }

 private:
  struct Level {
    double piece_m;
    ModelSamples samples;
  };

  // From the first scale to the last.
  void follow(const XrayViews& views, KernelFlow& flow, RegistrationResult& result) const {
    double scale_px = std::max(settings_.first_scale_px, settings_.last_scale_px);
    while (true) {
      const bool last = scale_px <= settings_.last_scale_px;
      const ModelSamples& model = levelFor(scale_px / pixelsPerMetre(views, flow.pose().translation()));
      if (!flow.begin(model, PairKernel(scale_px, degToRad(settings_.direction_std_deg), settings_.objective))) return;
      const double rest_px = last ? kLastRest_px : kRestShare * scale_px;
      for (int k = 0; k < (last ? kMaxLastSteps : kMaxSteps); ++k) {
        result.last_step_px = flow.step();
        ++result.rigid_iterations;
        if (result.last_step_px < rest_px) break;
      }
      if (last) {
        result.covariance = flow.covariance(model, given_.centroid());
        return;
      }
      scale_px = std::max(settings_.last_scale_px, settings_.scale_decay * scale_px);
    }
  }

  const ModelSamples& levelFor(double scale_m) const {
    std::size_t k = 0;
    while (k + 1 < levels_.size() && levels_[k + 1].piece_m <= kPieceOfScale * scale_m) ++k;
    return levels_[k].samples;
  }

  void score(const XrayViews& given, RegistrationResult& result) const {
    const DensifiedViews seen(given, settings_.spacing_px);
    result.points_2d = pointsIn(seen.views());
    result.alignment = alignmentScore(scored_, scored_.points(), seen.views(), result.T_camera_model);
  }

  CvoSettings settings_;
  VesselTree given_;
  VesselTree scored_;
  std::vector<Level> levels_;
};

}  // namespace

std::unique_ptr<Registration> make(const CvoSettings& settings, const VesselTree& tree) {
  return std::make_unique<Cvo>(settings, tree);
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "methods.hpp"

#include <algorithm>

#include "angio/base/stopwatch.hpp"
#include "angio/registration/alignment_score.hpp"
#include "angio/vessel/resample.hpp"
#include "displacement_fit.hpp"
#include "distance_fit.hpp"
#include "fit_classification.hpp"

namespace angio::registration {
namespace {

// Longest edge of the model and most points of it, as the other methods have them.
constexpr double kModelSpacing_m = 1e-3;
constexpr int kMaxModelPoints = 3000;
// Longest step of the image's centreline that the result is judged by, also as they have it [px].
constexpr double kJudgedSpacing_px = 2;

// Starts near the truth need about 6 and 8; of those far off some are on their way for 100.
constexpr int kAffineIterations = 20, kRigidIterations = 100, kDisplacementIterations = 20;

class DtIcp final : public Registration {
 public:
  DtIcp(const DtIcpSettings& settings, const VesselTree& tree)
      : given_(tree),
        model_(resampled(tree, kModelSpacing_m, kMaxModelPoints)),
        points_centered_(model_.tree.points().colwise() - model_.tree.centroid()),
        loss_(settings) {
    // lambda2, w1, w2 and w3 are one set for both methods in the paper, section IV-A.
    if (settings.deformation == Deformation::kNonrigid) nonrigid_.emplace(model_.tree, IterativePnpSettings());
  }

  using Registration::align;

  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) override {
    const Stopwatch began;
    RegistrationResult result = resultAt(start, model_.tree.size(), views);
    if (nonrigid_) result.displacements_m.setZero(3, given_.size());
    const PosePriorTerm held = givenPrior(prior, model_.tree.centroid());
    result.prior = held.source;
    if (tooFewPoints(result)) return result;
    const DistanceFrame frame(views, kJudgedSpacing_px);
    result.points_2d = pointsIn(frame.views());
    result.times.prepare_s = began.seconds();

    Eigen::Matrix3Xd points = model_.tree.points();
    if (frame.usable()) {
      const Stopwatch rigid_began;
      alignRigid(frame, held, start, result);
      result.times.rigid_s = rigid_began.seconds();
      if (nonrigid_ && result.covariance) {
        const Stopwatch nonrigid_began;
        points += alignNonrigid(frame, result);
        result.times.nonrigid_s = nonrigid_began.seconds();
      }
    }
    result.alignment = alignmentScore(model_.tree, points, frame.views(), result.T_camera_model);
    classify(tree(), result);
    result.times.total_s = began.seconds();
    return result;
  }

  const VesselTree& tree() const override { return given_; }

 private:
  // Leaves the result's covariance absent where the start has no image.
  void alignRigid(const DistanceFrame& frame, const PosePriorTerm& prior, const Pose& start,
                  RegistrationResult& result) {
    const Eigen::Translation3d to_center(model_.tree.centroid());
    PoseFit fit(frame, loss_.get(), points_centered_, prior, start * to_center);
    result.rigid_iterations = fit.affine(kAffineIterations).iterations;
    const StageResult rigid = fit.rigid(kRigidIterations);
    if (!rigid.solved) return;
    result.rigid_iterations += rigid.iterations;
    result.last_step_px = rigid.last_step_px;
    rigid_at_rest_ = rigid.iterations < kRigidIterations;
    result.T_camera_model = fit.T_camera_centered() * to_center.inverse();
    if (const auto about_centroid = fit.covariance()) {
      result.covariance = covarianceOfResult(*about_centroid, result.T_camera_model, model_.tree.centroid());
    }
  }

  // Returns the displacements of the model's points.
  Eigen::Matrix3Xd alignNonrigid(const DistanceFrame& frame, RegistrationResult& result) {
    Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, model_.tree.size());
    const StageResult stage =
        nonrigid_->solve(frame, loss_.get(), result.T_camera_model, kDisplacementIterations, displacements);
    result.nonrigid_iterations = stage.iterations;
    // Displacements follow the image from any pose: one that was still on its way is not believed for coming to rest
    // so.
    result.last_step_px = std::max(result.last_step_px, stage.last_step_px);
    result.displacements_m = model_.ofOriginal(displacements);
    return displacements;
  }

  VesselTree given_;
  ResampledTree model_;
  Eigen::Matrix3Xd points_centered_;
  ChosenLoss loss_;
  std::optional<DisplacementFit> nonrigid_;
  bool rigid_at_rest_ = false;  // Of the last alignment.
};

}  // namespace

std::unique_ptr<Registration> make(const DtIcpSettings& settings, const VesselTree& tree) {
  return std::make_unique<DtIcp>(settings, tree);
}

}  // namespace angio::registration

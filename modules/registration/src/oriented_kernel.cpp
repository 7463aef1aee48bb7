// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/decompositions.hpp"
#include "methods.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/stopwatch.hpp"
#include "angio/registration/alignment_score.hpp"
#include "deformation_fit.hpp"
#include "field_search.hpp"
#include "fit_classification.hpp"
#include "fit_uncertainty.hpp"
#include "frame_evidence.hpp"
#include "line_fit.hpp"
#include "model_error.hpp"
#include "pose_comparison.hpp"
#include "pose_prior_term.hpp"
#include "same_place.hpp"
#include "search_passes.hpp"

namespace angio::registration {
namespace {

// An image that shows less than this share of what the model should show is fitted from its own side: most of the model
// has no part in it, and would pull to whatever is near.
constexpr double kSmallImage = 0.25;

// Shifts of a small image reach so many standard deviations of the belief: a start may be off by more than it says.
constexpr double kShiftReach = 4;

// A small image is all that there is: a candidate is fitted from further away, and the best again.
constexpr LineFitPlan kSmallQuick{32, 500, 500, 5, 0.1};
constexpr double kSmallGate_px = 12, kSmallTracked_px = 24;
// Rotations and depths that are tried for it, and places that are compared.
constexpr int kShiftHypotheses = 48;
constexpr std::size_t kShiftPlaces = 32;

// A deformation that explains no more, and brings the image no nearer than this, is none.
constexpr double kSameResidual_px = 0.05;
// An alternative with less than this share of the rigid score is none, also when it may be deformed.
constexpr double kWorthDeforming = 0.5;
// So many alternatives are deformed.
constexpr int kMaxDeformed = 3;
// What fits to the wrong tree reach: below that score, with an alternative that does nearly as well, nothing has been
// found.
constexpr double kChanceScore = 0.12, kChanceAlternative = 0.5;

// The belief with its translations as uncertain as far as shifts are searched.
PosePriorTerm shiftsFreed(PosePriorTerm belief) {
  Vector6d scale = Vector6d::Ones();
  scale.head<3>().setConstant(1 / kShiftReach);
  belief.information = (scale.asDiagonal() * belief.information * scale.asDiagonal()).eval();
  return belief;
}

PosePriorTerm widenedBy(double factor, PosePriorTerm belief) {
  belief.information /= factor * factor;
  return belief;
}

// Of the belief, of a search that nobody gave a covariance; and around what has been found.
constexpr double kWidest = 3;
constexpr double kNearby = 0.5;
constexpr int kNearbyRounds = 3;
constexpr std::size_t kCompared = 4;

class OrientedKernel final : public Registration {
 public:
  OrientedKernel(const OrientedKernelSettings& settings, const VesselTree& tree)
      : settings_(settings),
        given_(tree),
        model_(tree, settings),
        fields_(model_),
        lines_(model_),
        comparison_(model_, fields_, lines_) {
    if (settings_.deformation == Deformation::kNonrigid) deformation_.emplace(model_, settings_.nonrigid);
  }

  using Registration::align;
  using Registration::search;

  RegistrationResult align(const XrayViews& views, const PosePrior& prior, const Pose& start) override {
    const Stopwatch began;
    RegistrationResult result;
    auto belief = begin(views, prior, start, result);
    if (!belief) return result;
    PoseCandidate candidate{centered(start), 0};
    LineFitPlan plan = kFull;
    if (small_) {
      // One curve says little, and must not be outweighed by a start that is off.
      belief = shiftsFreed(*belief);
      plan = {kSmallTracked_px, 500, 100000, 12, 0.1};
    } else {
      const double off_px = spread_px(*belief, candidate.T_camera_centered);
      int scale = 0;
      while (scale + 1 < kFieldScales && kFieldScales_px[static_cast<std::size_t>(scale) + 1] >= off_px) ++scale;
      for (; scale < kFieldScales; ++scale) {
        const auto& points = model_.subsets[static_cast<std::size_t>(scale) + 1];
        result.rigid_iterations +=
            fields_.ascend(frame_, *belief, points, scale, 6, {SearchPass::kSomeEmpty}, candidate);
      }
    }
    finish(*belief, candidate.T_camera_centered, plan, result);
    result.times.rigid_s = began.seconds() - result.times.prepare_s;
    const Pose rigid = centered(result.T_camera_model);
    deform(*belief, result);
    if (result.status == RegistrationStatus::kConverged && comparison_.mirrorIsOpen(*belief, rigid)) {
      classifyAlternatives(*belief, rigid, {}, result);
    }
    result.times.total_s = began.seconds();
    return result;
  }

  RegistrationResult search(const XrayViews& views, const PosePrior& prior, const StartSettings& starts,
                            const SearchProgress& progress) override {
    const Stopwatch began;
    checkSettings("starts", starts);
    if (starts.count == 1 && !starts.box()) return align(views, prior, prior.T_camera_model);
    RegistrationResult result;
    const auto belief = begin(views, beforeSearch(prior, starts), prior.T_camera_model, result);
    if (!belief) return result;
    bool first = true;
    std::vector<PoseCandidate> alternatives;
    // Fits the candidates under a belief and keeps the best of them if it is better than what there is.
    const auto take = [&](PosePriorTerm wide, std::vector<PoseCandidate> candidates) {
      // A small image says little about where it may be: what it does say must not be outweighed by a start that is far
      // off.
      if (small_) wide = shiftsFreed(wide);
      comparison_.rank(wide, candidates, small_ ? kSmallQuick : kQuick);
      RegistrationResult found = result;
      LineFitPlan plan = kFull;
      if (small_) plan.gate_px = kSmallGate_px;
      finish(wide, candidates.front().T_camera_centered, plan, found);
      found.times.rigid_s = began.seconds() - result.times.prepare_s;
      const Pose rigid = centered(found.T_camera_model);
      deform(wide, found);
      // Draws around one pose know no other: what earlier ones came upon is asked as well.
      alternatives.insert(alternatives.end(), candidates.begin(), candidates.end());
      classifyAlternatives(wide, rigid, alternatives, found);
      const auto merit = [](const RegistrationResult& r) { return r.alignment.score() * (1 - *r.ambiguity); };
      const bool is_better = first || merit(found) > merit(result);
      if (is_better) result = found;
      first = false;
      return is_better;
    };
    const auto byLuck = [&] { return result.alignment.score() < kChanceScore; };
    const auto settled = [&] {
      const bool alone = *result.ambiguity < kChanceAlternative && !byLuck() && result.last_step_px <= kAtRest_px;
      return small_ || result.status == RegistrationStatus::kConverged || alone;
    };
    for (const SearchPass& pass : searchPasses(starts, prior)) {
      // A fit that is explained fails for what one view leaves open, and a deformed one that is not explained by luck
      // for what it cannot follow: no emptier tree changes that.
      if (!first && pass.frame.outlier_mass > SearchPass::kSomeEmpty &&
          (explained(result) || (deformation_ && !byLuck())))
        continue;
      const PosePriorTerm wide = widenedBy(pass.widened, *belief);
      auto candidates = small_ ? candidatesByShifts(wide, starts)
                               : candidatesByFields(wide, starts, pass, first ? progress : SearchProgress());
      if (candidates.empty()) break;
      take(wide, std::move(candidates));
      // What is explained, and not well, is often near the right pose and kept from it by the belief: once more from
      // there.
      const bool try_nearby = pass.widened > 1 || pass.frame.outlier_mass > SearchPass::kSomeEmpty || !byLuck();
      bool moved = try_nearby && !explained(result);
      const int rounds = deformation_ ? 1 : kNearbyRounds;
      for (int round = 0; round < rounds && moved && !settled(); ++round) {
        PosePriorTerm there = widenedBy(kNearby, *belief);
        there.T0_camera_centered = centered(result.T_camera_model);
        StartSettings nearby = starts;
        nearby.box_rotation_deg = nearby.box_translation_mm = 0;
        moved = take(prior.covariance ? *belief : widenedBy(kWidest, *belief),
                     candidatesByFields(there, nearby, {1, pass.frame}, {}));
      }
      // In doubt a little wider; far wider only when nothing has been found.
      if (settled() || (pass.widened > 1 && !byLuck())) break;
    }
    if (progress) progress(1);
    result.times.total_s = began.seconds();
    return result;
  }

  const VesselTree& tree() const override { return given_; }

 private:
  /// What all registrations of a frame begin with; nothing when there are too few points.
  std::optional<PosePriorTerm> begin(const XrayViews& views, const PosePrior& prior, const Pose& start,
                                     RegistrationResult& result) {
    const Stopwatch stage;
    result.T_camera_model = start;
    result.points_3d = model_.size();
    if (deformation_) result.displacements_m.setZero(3, given_.size());
    frame_.begin(views, settings_);
    result.points_2d = frame_.pointCount();
    result.times.prepare_s = stage.seconds();
    const PosePriorTerm belief = beliefOf(prior, settings_, model_.centroid);
    result.prior = belief.source;
    PosePrior start_alone;
    start_alone.T_camera_model = prior.T_camera_model;
    usual_belief_ = beliefOf(start_alone, settings_, model_.centroid);
    if (tooFewPoints(result)) return std::nullopt;
    small_ = settings_.direction == Direction::kImageToModel ||
             (settings_.direction == Direction::kAuto && imageIsSmall(centered(start)));
    comparison_.begin(frame_, small_);
    return belief;
  }

  bool imageIsSmall(const Pose& T_camera_centered) const {
    const ModelPoints& points = model_.subsets.back();
    double length_px = 0;
    for (std::size_t v = 0; v < frame_.viewCount(); ++v) {
      const XrayView& view = frame_.views()[v];
      const Pose T = view.T_view_first * T_camera_centered;
      for (int i = 0; i < points.count; ++i) {
        const Eigen::Vector3d p = T * Eigen::Vector3d(points.x[i], points.y[i], points.z[i]);
        const auto pixel = view.camera.project(p);
        if (!pixel || !view.camera.sees(*pixel)) continue;
        const Eigen::Vector3d t = T.linear() * Eigen::Vector3d(points.tx[i], points.ty[i], points.tz[i]);
        const Eigen::Vector2d d = (t.head<2>() - p.head<2>() * (t.z() / p.z())) / p.z();
        length_px += view.camera.parameters().fx_px * d.norm() * points.weight[i] * model_.spacing_m;
      }
    }
    length_px *= static_cast<double>(model_.size()) / points.count;
    return frame_.length_px() < kSmallImage * length_px;
  }

  // How far the belief lets the projection be off, rms.
  double spread_px(const PosePriorTerm& belief, const Pose& T_camera_centered) const {
    const Matrix6d covariance = inverseOf(belief.information);
    const double pixels_per_metre =
        frame_.views().front().camera.parameters().fx_px / std::max(0.05, T_camera_centered.translation().z());
    return pixels_per_metre *
           std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3 +
                     model_.radius_m * model_.radius_m * covariance.bottomRightCorner<3, 3>().trace() / 3);
  }

  // For all of the tree in view: starts on the fields. `belief` has been widened so many times.
  std::vector<PoseCandidate> candidatesByFields(const PosePriorTerm& belief, const StartSettings& starts,
                                                const SearchPass& pass, const SearchProgress& progress) {
    const double widened = pass.widened;
    std::vector<PoseCandidate> candidates;
    if (frame_.viewCount() == 1 && (widened > 2 || starts.box())) {
      // Too wide for draws to hit every basin: all shifts for each draw of rotation and depth.
      candidates = fields_.everyShift(frame_, draws_.withoutShift(belief, starts, pass.draws),
                                      shiftReach_m(belief, starts, 2.5), pass.frame, pass.candidates, progress);
    } else {
      const int count = starts.count > 0 ? starts.count : settings_.starts;
      const int more = starts.box() ? 32 : widened > 2 ? 16 : widened > 1 ? 4 : 1;
      for (const Pose& T : draws_.poses(belief, starts, more * count)) candidates.push_back({T, 0});
    }
    fields_.halve(frame_, belief, pass.frame, candidates, kCompared);
    return candidates;
  }

  // For a small image: shifts of rotations and depths.
  std::vector<PoseCandidate> candidatesByShifts(const PosePriorTerm& belief, const StartSettings& starts) {
    return searchShifts(model_, frame_, draws_.withoutShift(belief, starts, kShiftHypotheses),
                        shiftReach_m(belief, starts, kShiftReach), kShiftPlaces);
  }

  // Compares the result with its best alternative. `T_rigid` is its pose before it was deformed.
  void classifyAlternatives(const PosePriorTerm& belief, const Pose& T_rigid, const std::vector<PoseCandidate>& others,
                            RegistrationResult& result) {
    const double own = comparison_.score(belief, T_rigid);
    std::vector<Pose> known{T_rigid};
    double share = 1;
    for (int asked = 0;; ++asked) {
      const PoseCandidate alternative = comparison_.bestAlternative(belief, known, others);
      share = own > 0 ? std::min(1.0, alternative.score / own) : 1.0;
      if (!deformation_ || !(alternative.score > 0) || share <= kWorthDeforming || asked == kMaxDeformed) break;
      // Before it is deformed the right pose fits little better than a wrong one.
      const Stopwatch stage;
      PosePriorTerm there = belief;
      there.T0_camera_centered = alternative.T_camera_centered;
      const auto fit = deformation_->fit(frame_, there, alternative.T_camera_centered, DeformationFit::Aim::kCompare);
      const VesselTree& tree = model_.resampled.tree;
      const Pose T = fit.T_camera_centered * Eigen::Translation3d(-model_.centroid);
      const Eigen::Matrix3Xd points = tree.points() + fit.displacements_m;
      const double score = result.alignment.score();
      const double its_score = alignmentScore(tree, points, frame_.views(), T).score();
      result.times.nonrigid_s += stage.seconds();
      share = score > 0 ? std::min(1.0, its_score / score) : 1.0;
      if (!isWhereFound(T, points, result)) break;
      // The same answer from elsewhere: the deformation has made up for the difference.
      known.push_back(alternative.T_camera_centered);
    }
    classifyAgainst(share, model_.resampled.tree, result);
  }

  // Whether a deformed tree lies where the result has it.
  bool isWhereFound(const Pose& T_camera_model, const Eigen::Matrix3Xd& points,
                    const RegistrationResult& result) const {
    if (!result.spread) return false;
    Eigen::Matrix3Xd found = given_.points();
    if (result.displacements_m.cols() == found.cols()) found += result.displacements_m;
    const Eigen::Matrix3Xd there = T_camera_model * model_.resampled.ofOriginal(points);
    return isSamePlace(result.T_camera_model * found, there, frame_.viewCount() == 1, result.spread->all_m);
  }

  void finish(const PosePriorTerm& belief, const Pose& T_camera_centered, const LineFitPlan& plan,
              RegistrationResult& result) {
    const LineFitResult fit = lines_.fit(frame_, belief, T_camera_centered, plan);
    result.T_camera_model = fit.T_camera_centered * Eigen::Translation3d(-model_.centroid);
    result.rigid_iterations += fit.steps;
    result.last_step_px = fit.last_step_px;
    if (fit.information.allFinite() && fit.information.diagonal().minCoeff() > 0) {
      auto groups = lines_.residuals(frame_, fit.T_camera_centered);
      const auto error = std::make_shared<ModelError>(groups, fit.information, fit.currency, length_m());
      setUncertainty(error, model_.points, centered(result.T_camera_model), model_.centroid, result);
      keepEvidence(std::move(groups), fit.T_camera_centered, model_.points, result);
    }
  }

  // Deforms the tree if that is allowed and explains what the rigid pose does not, and classifies the result.
  void deform(const PosePriorTerm& belief, RegistrationResult& result) {
    const VesselTree& tree = model_.resampled.tree;
    result.alignment = alignmentScore(tree, tree.points(), frame_.views(), result.T_camera_model);
    if (!deformation_) {
      classify(tree, result);
      return;
    }
    const Stopwatch stage;
    const auto fit = deformation_->fit(frame_, belief, centered(result.T_camera_model));
    const Pose deformed_pose = fit.T_camera_centered * Eigen::Translation3d(-model_.centroid);
    const AlignmentScore deformed =
        alignmentScore(tree, tree.points() + fit.displacements_m, frame_.views(), deformed_pose);
    // Pose and deformation share what one view cannot tell apart: an image that the rigid tree explains as well must
    // not move it.
    const AlignmentScore& rigid = result.alignment;
    const bool needed = rigid.score() < deformed.score() - kSameScore ||
                        rigid.image_residual_px > 1.1 * deformed.image_residual_px + kSameResidual_px;
    result.displacements_m.setZero(3, given_.size());
    if (needed) {
      result.T_camera_model = deformed_pose;
      result.displacements_m = model_.resampled.ofOriginal(fit.displacements_m);
      if (fit.posterior) {
        // One view's posterior is wide enough where nothing was matched: a loop would hold for a vessel that a frame
        // does not show.
        auto misfit = std::make_shared<LocalMisfit>(frame_.views(), model_, model_.points + fit.displacements_m,
                                                    fit.T_camera_centered, frame_.viewCount() > 1);
        const Claims claims = claimsOfDeformed(deformed, frame_.viewCount(), std::move(misfit));
        result.low_score_suffices = isNearStart(usual_belief_, fit.T_camera_centered);
        setUncertainty(fit.posterior, model_.points, centered(result.T_camera_model), model_.centroid, result, claims);
        keepEvidence(fit.groups, fit.T_groups_camera_centered, model_.points + fit.displacements_m, result);
      } else {
        result.covariance = covarianceOfResult(fit.pose_covariance, result.T_camera_model, model_.centroid);
        result.noise_covariance.reset();
        result.deformation_std_m = 0;
        result.spread.reset();
        result.points.reset();
        result.evidence.reset();
      }
      result.last_step_px = fit.last_step_px;
      result.alignment = deformed;
    }
    result.nonrigid_iterations = fit.iterations;
    result.times.nonrigid_s = stage.seconds();
    classify(tree, result);
  }

  void keepEvidence(std::vector<ResidualGroup> groups, const Pose& T_camera_centered, const Eigen::Matrix3Xd& displaced,
                    RegistrationResult& result) const {
    if (frame_.viewCount() != 1) return;
    result.evidence = std::make_shared<FrameEvidence>(
        FrameEvidence{frame_.views().front().camera, frame_.views().front().T_view_first * T_camera_centered,
                      model_.centroid, displaced.rowwise().mean(), std::move(groups)});
  }

  Pose centered(const Pose& T_camera_model) const { return T_camera_model * Eigen::Translation3d(model_.centroid); }
  double length_m() const { return 1e-3 * settings_.nonrigid.length_mm; }

  OrientedKernelSettings settings_;
  VesselTree given_;
  OrientedModel model_;
  FieldSearch fields_;
  LineFit lines_;
  std::optional<DeformationFit> deformation_;
  OrientedFrame frame_;
  PoseComparison comparison_;
  StartDraws draws_;
  PosePriorTerm usual_belief_;  // The settings' own of the start, whatever is believed.
  bool small_ = false;
};

}  // namespace

std::unique_ptr<Registration> make(const OrientedKernelSettings& settings, const VesselTree& tree) {
  return std::make_unique<OrientedKernel>(settings, tree);
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_fit.hpp"

#include <algorithm>
#include <cmath>

#include "across_beam.hpp"
#include "line_gate.hpp"
#include "oriented_frame.hpp"

namespace angio::registration {
namespace {

// Modes are for deformations of half the length too: of a stiffer field the lines that follow are the wrong ones.
constexpr double kModesLength = 0.5;

// On the fields: scales of 16 and 8 px, few points and the longest modes. An expectation-maximisation step goes too
// short; a step that extrapolates by less than two gets there in half as many (measured).
constexpr int kFirstScale = 1, kStepsPerScale = 6, kFieldPoints = 600;
constexpr Eigen::Index kFieldModes[kFieldScales] = {16, 16, 24};
constexpr double kFitOutlierMass = 0.5, kAlong = 0.1, kFieldExtrapolation = 1.8, kFieldRest = 0.03;

// On the lines: rounds of matching and one step.
constexpr int kSmoothRounds = 6, kLocalRounds = 2, kLinesAloneRounds = 16, kLinesAloneLocalRounds = 5;
constexpr double kLinesAloneLocal = 4;  // Times the correction that is expected otherwise.
constexpr double kFirstGate_px = 12, kLinesAloneGate_px = 24, kLinesAloneMinGate_px = 10;
constexpr double kLineExtrapolation = 1.5, kRest_px = 0.02;
constexpr double kWideGate_px = 5;  // While matches are this uncertain, fewer points are enough.
constexpr int kWidePoints = 1000, kNarrowPoints = 1300;

// What the model itself leaves unexplained, and the length of vessel over which that stays the same: the smooth modes
// are no better than a pixel, and the pose must not change to make up for it.
struct Misfit {
  double min_noise_px, together_px;
};
constexpr Misfit kSmoothMisfit = {1, 15}, kLocalMisfit = {0.3, 4};
constexpr Misfit kLinesAloneMisfit = {0.5, 4};  // One curve in a large tree: every bend of it counts.

// How often the image is matched for the posterior, which decides in the end: in several views, which pull a tree
// straight that was matched with neighbours, once more and from further away.
constexpr int kPosteriorRounds = 2, kViewsRounds = 3;
constexpr double kLastViewsGate_px = 6;

}  // namespace

// One fit: the unknowns, and the steps that change them.
template <int D>
class DeformationFit::Run {
 public:
  using Field = Eigen::Matrix<double, D, Eigen::Dynamic>;
  using Directions = Eigen::Matrix<double, 3, D>;

  Run(DeformationFit& fit, OrientedFrame& frame, const PosePriorTerm& belief, const Pose& T,
      const Directions& directions)
      : fit_(fit),
        frame_(frame),
        belief_(belief),
        T_(T),
        w_(Field::Zero(D, fit.modes_.cols())),
        e_(Field::Zero(D, fit.nodes_.size())),
        displaced_(fit.model_.points),
        data_(fit.nodes_, directions) {
    if (fit_.matches_.size() < frame_.viewCount()) fit_.matches_.resize(frame_.viewCount());
    if (fit_.chosen_.size() < frame_.viewCount()) fit_.chosen_.resize(frame_.viewCount());
  }

  Result operator()(Aim aim) {
    const bool full = fit_.settings_.detail == DeformationDetail::kFull;
    const bool lines_alone = shareShown() < kFewLines;
    if (lines_alone) {
      gate_.gate_px = kLinesAloneGate_px;
      gate_.tolerance_px = gate_.gate_px / 2;
      gate_.min_gate_px = kLinesAloneMinGate_px;
    } else {
      for (int scale = kFirstScale; scale < kFieldScales; ++scale) climb(scale);
    }
    followLines(lines_alone ? kLinesAloneRounds : kSmoothRounds, lines_alone ? kLinesAloneMisfit : kSmoothMisfit,
                false);
    alone_ = lines_alone;
    if (full) followLines(lines_alone ? kLinesAloneLocalRounds : kLocalRounds, kLocalMisfit, true);
    if (aim == Aim::kResult) {
      conclude();
      if (frame_.viewCount() == 1 && result_.posterior) {
        // One view's process and groups leave depth to the belief, and are too coarse across the beam for large
        // deformations.
        if (result_.posterior->amplitude_m() > kWorthRefining_m) {
          displaced_ = refinedAcrossBeam(fit_.model_, fit_.nodes_, 1e-3 * fit_.settings_.length_mm, frame_,
                                         frame_.views().front().T_view_first * T_, displaced_, gate_);
        }
        showFrame();
      }
    }
    result_.T_camera_centered = T_;
    result_.T_camera_centered.linear() = nearestRotation(T_.linear());
    result_.displacements_m = displaced_ - fit_.model_.points;
    return result_;
  }

 private:
  DeformedView viewOf(std::size_t v) const {
    return {frame_.views()[v].camera, frame_.views()[v].T_view_first * T_, displaced_};
  }
  double pixelsPerMetre(std::size_t v) const {
    const Pose T = frame_.views()[v].T_view_first * T_;
    return frame_.views()[v].camera.parameters().fx_px / std::max(0.05, T.translation().z());
  }

  double shareShown() {
    double model_px = 0;
    for (std::size_t v = 0; v < frame_.viewCount(); ++v) {
      const DeformedView view = viewOf(v);
      fit_.projected_.project(view.points, fit_.model_.edges, view.camera, view.T_view_centered);
      model_px += fit_.projected_.length_px();
    }
    return frame_.length_px() / std::max(1.0, model_px);
  }

  void climb(int scale) {
    const double scale_px = kFieldScales_px[scale];
    const int stride = std::max(1, fit_.model_.size() / kFieldPoints);
    PullWeight pull;
    pull.outlier_mass = static_cast<float>(kFitOutlierMass);
    pull.along = static_cast<float>(kAlong);
    for (int step = 0; step < kStepsPerScale; ++step) {
      data_.clear();
      for (std::size_t v = 0; v < frame_.viewCount(); ++v) {
        // Points nearer to each other than the kernel is wide say the same thing: they count as one.
        const double independent = std::min(1.0, pixelsPerMetre(v) * fit_.model_.spacing_m * stride / scale_px);
        data_.addFieldPull(viewOf(v), fit_.model_, frame_.field(v, scale), frame_.fieldOfView(v), pull, stride,
                           independent);
      }
      stepModes(kFieldModes[scale], kFieldExtrapolation);
      if (result_.last_step_px < kFieldRest * scale_px) break;
    }
  }

  // Matches the image and linearises what is left; false where nothing is matched.
  bool pullLines(const Misfit& misfit, bool local) {
    const double point_px = frame_.length_px() / std::max(1, frame_.pointCount()) * match(local);
    const double noise_px = std::max(gate_.noise_px, misfit.min_noise_px);
    const double weight = std::min(1.0, point_px / misfit.together_px) / (noise_px * noise_px);
    data_.clear();
    for (std::size_t v = 0; v < frame_.viewCount(); ++v) {
      data_.addLinePull(viewOf(v), fit_.model_, fit_.chosen_[v], fit_.matches_[v], gate_.tolerance_px, weight);
    }
    if (!(data_.weight > 0)) return false;
    gate_.noise_px = noiseBehind(data_.squares_px2 / data_.weight, gate_.tolerance_px);
    return true;
  }

  void followLines(int rounds, const Misfit& misfit, bool local) {
    for (int round = 0; round < rounds; ++round) {
      if (!pullLines(misfit, local)) return;
      if (local)
        stepLocal();
      else
        stepModes(w_.cols(), kLineExtrapolation);
      gate_.tighten();
      if (round >= 2 && result_.last_step_px < kRest_px) return;
    }
  }

  // Matches image points of all views; returns how many stand for one.
  int match(bool local) {
    const int wanted = gate_.gate_px > kWideGate_px ? kWidePoints : kNarrowPoints;
    const int stride = local ? 1 : std::max(1, (frame_.pointCount() + wanted - 1) / wanted);
    for (std::size_t v = 0; v < frame_.viewCount(); ++v) {
      const DeformedView view = viewOf(v);
      fit_.projected_.project(view.points, fit_.model_.edges, view.camera, view.T_view_centered);
      thinned(frame_.points(v), stride, fit_.chosen_[v]);
      matchLines(fit_.chosen_[v], fit_.projected_, gate_.gate_px, kMinCos2, fit_.matches_[v]);
    }
    return stride;
  }

  void stepModes(Eigen::Index max_modes, double extrapolation) {
    Matrix6d H = data_.H;
    Vector6d g = data_.g;
    belief_.add(T_, H, g);
    const Eigen::Index count = std::min(max_modes, w_.cols());
    const auto step = data_.solveModes(fit_.modes_, w_.leftCols(count), H, g);
    if (!step) return;
    const Eigen::Matrix3Xd before = T_ * displaced_;
    result_.pose_covariance = step->pose_covariance;
    T_ = T_ * expSE3(extrapolation * step->dx);
    w_.leftCols(count) += extrapolation * step->change;
    moved(before);
  }

  void stepLocal() {
    const Eigen::Matrix3Xd before = T_ * displaced_;
    e_ += data_.solveChain(alone_ ? fit_.local_alone_ : fit_.local_, e_).change;
    moved(before);
  }

  void moved(const Eigen::Matrix3Xd& before) {
    const Field at_nodes = w_ * fit_.modes_.transpose() + e_;
    displaced_ = fit_.model_.points + fit_.nodes_.atPoints(data_.directions * at_nodes);
    const Eigen::Matrix3Xd change = T_ * displaced_ - before;
    const double rms_m = std::sqrt(change.topRows<2>().squaredNorm() / static_cast<double>(change.cols()));
    result_.last_step_px = pixelsPerMetre(0) * rms_m;
    ++result_.iterations;
  }

  std::vector<MatchedView> matchedViews() const {
    std::vector<MatchedView> views;
    for (std::size_t v = 0; v < frame_.viewCount(); ++v) {
      views.push_back({viewOf(v).camera, viewOf(v).T_view_centered, fit_.chosen_[v], fit_.matches_[v]});
    }
    return views;
  }

  // What this frame says among others.
  void showFrame() {
    if (!pullLines(kLocalMisfit, true)) return;
    result_.groups = residualGroups(matchedViews(), fit_.model_, displaced_, gate_.tolerance_px, kFrameGroups);
    result_.T_groups_camera_centered = T_;
  }

  // Pose and displacements become their posterior means given the matches, which are made again where those are.
  void conclude() {
    const bool one_view = frame_.viewCount() == 1;
    const int rounds = one_view ? kPosteriorRounds : kViewsRounds;
    for (int round = 0; round < rounds; ++round) {
      const bool last = round + 1 == rounds;
      if (last && !one_view) gate_.gate_px = kLastViewsGate_px;
      if (!pullLines(kLocalMisfit, true)) return;
      const std::vector<MatchedView> views = matchedViews();
      const auto groups =
          residualGroups(views, fit_.model_, displaced_, gate_.tolerance_px, one_view ? kOneViewGroups : kViewsGroups);
      if (groups.size() < static_cast<std::size_t>(kMinGroups)) return;
      const auto posterior = std::make_shared<DeformationPosterior>(
          groups, belief_, T_, 1e-3 * fit_.settings_.length_mm, one_view ? kOneViewShape : kViewsShape);
      if (!posterior->known()) return;
      result_.posterior = posterior;
      result_.pose_covariance = posterior->twistCovariance();
      T_ = T_ * expSE3(posterior->twist());
      displaced_ = fit_.model_.points + fit_.nodes_.atPoints(posterior->displacements(fit_.nodes_.points));
      gate_.tighten();
    }
  }

  DeformationFit& fit_;
  OrientedFrame& frame_;
  const PosePriorTerm& belief_;
  Pose T_;
  Field w_, e_;  // Weights of the modes, and corrections of the nodes [m].
  Eigen::Matrix3Xd displaced_;
  DeformationEquations<D> data_;
  LineGate gate_ = lineGate(kFirstGate_px);
  bool alone_ = false;
  Result result_;
};

DeformationFit::DeformationFit(const OrientedModel& model, const DeformationSettings& settings)
    : model_(model),
      settings_((checkSettings("nonrigid", settings), settings)),
      nodes_(model, 1e-3 * settings.node_mm),
      modes_(smoothModes(nodes_.points, 1e-3 * settings.std_mm, kModesLength * 1e-3 * settings.length_mm,
                         settings.max_modes)),
      local_(nodes_, 1e-3 * settings.local_std_mm, 1e-3 * settings.local_length_mm),
      local_alone_(nodes_, kLinesAloneLocal * 1e-3 * settings.local_std_mm, 1e-3 * settings.local_length_mm) {}

DeformationFit::Result DeformationFit::fit(OrientedFrame& frame, const PosePriorTerm& belief, const Pose& T_rigid,
                                           Aim aim) {
  if (frame.viewCount() > 1) return Run<3>(*this, frame, belief, T_rigid, Eigen::Matrix3d::Identity())(aim);
  const Eigen::Matrix3d R = (frame.views().front().T_view_first * T_rigid).linear();
  return Run<2>(*this, frame, belief, T_rigid, R.topRows<2>().transpose())(aim);
}

}  // namespace angio::registration

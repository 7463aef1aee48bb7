// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/catheter_localiser.hpp"

#include <cmath>

#include "angio/base/formatted.hpp"
#include "tip_filter.hpp"

namespace angio::localisation {

class CatheterLocaliser::Filter {
 public:
  Filter(const LocaliserSettings& settings, const VesselTree& tree)
      : forward_(settings, makePlaceGrid(tree, 1e-3 * settings.spacing_mm), tree.centroid()) {
    forget();
  }

  void forget() {
    seen_before_ = false;
    belief_ = forward_.summarised(forward_.probability());
  }

  const TipBelief& update(const SeenCatheter& seen, const SeenPose& pose, const CatheterMotion& motion) {
    forward_.predict(motion);
    return believed(forward_.observe(seen, pose));
  }

  const TipBelief& update(const TipEvidence& evidence, const CatheterMotion& motion) {
    forward_.predict(motion);
    const FrameOutcome outcome = forward_.observe(evidence);
    return believed(outcome, tipEndStd_m(evidence, forward_.summarised(forward_.probability()).tip));
  }

  const TipBelief& predict(const CatheterMotion& motion) {
    forward_.predict(motion);
    belief_ = forward_.summarised(forward_.probability());
    belief_.status = seen_before_ ? BeliefStatus::kPredicted : BeliefStatus::kUnknown;
    belief_.why = "no catheter is seen";
    return belief_;
  }

  TipFilter& forward() { return forward_; }
  const TipBelief& belief() const { return belief_; }

 private:
  const TipBelief& believed(const FrameOutcome& outcome, double end_std_m = 0) {
    belief_ = forward_.summarised(forward_.probability());
    belief_.why = outcome.why;
    belief_.residual_px = outcome.residual_px;
    belief_.shift_px = outcome.shift_px;
    seen_before_ = seen_before_ || outcome.used;
    belief_.status = outcome.used          ? BeliefStatus::kSeen
                     : outcome.residual_px ? BeliefStatus::kLost
                     : seen_before_        ? BeliefStatus::kPredicted
                                           : BeliefStatus::kUnknown;
    const double near_m = 1e-3 * forward_.settings().near_mm;
    if (end_std_m > 0) belief_.near_probability *= std::erf(near_m / (std::sqrt(2.0) * end_std_m));
    if (outcome.used && belief_.near_probability < forward_.settings().min_probability) {
      belief_.status = BeliefStatus::kUnsure;
      belief_.why = formatted("the tip is within %.1f mm of its place with a probability of %.2f only",
                              forward_.settings().near_mm, belief_.near_probability);
    }
    return belief_;
  }

  TipFilter forward_;
  TipBelief belief_;
  bool seen_before_ = false;
};

CatheterLocaliser::CatheterLocaliser(const LocaliserSettings& settings, const VesselTree& tree) {
  checkSettings("catheter localiser", settings);
  filter_ = std::make_unique<Filter>(settings, tree);
}
CatheterLocaliser::~CatheterLocaliser() = default;
CatheterLocaliser::CatheterLocaliser(CatheterLocaliser&&) noexcept = default;
CatheterLocaliser& CatheterLocaliser::operator=(CatheterLocaliser&&) noexcept = default;

TipBelief CatheterLocaliser::update(const TipEvidence& evidence, const CatheterMotion& motion) {
  return filter_->update(evidence, motion);
}

TipBelief CatheterLocaliser::update(const SeenCatheter& seen, const SeenPose& pose, const CatheterMotion& motion) {
  return filter_->update(seen, pose, motion);
}

TipBelief CatheterLocaliser::predict(const CatheterMotion& motion) { return filter_->predict(motion); }

void CatheterLocaliser::reset() {
  filter_->forward().reset();
  filter_->forget();
}

void CatheterLocaliser::reset(int chain, double arc_m, double std_m) {
  filter_->forward().reset(chain, arc_m, std_m);
  filter_->forget();
}

const TipBelief& CatheterLocaliser::belief() const { return filter_->belief(); }

Eigen::Vector3d tipOnRay(const TipPlace& place, const SeenCatheter& seen, const SeenPose& pose) {
  if (seen.tip_end != TipEnd::kLast || seen.points_px.cols() == 0) return place.tip_model;
  const Eigen::Vector3d ray = pose.camera.ray(seen.points_px.rightCols<1>()).normalized();
  const Eigen::Vector3d on_axis = pose.T_camera_model * place.tip_model;
  return pose.T_camera_model.inverse() * Eigen::Vector3d(ray.dot(on_axis) * ray);
}

}  // namespace angio::localisation

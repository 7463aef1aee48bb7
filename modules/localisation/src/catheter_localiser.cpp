// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/localisation/catheter_localiser.hpp"

#include <cmath>

#include "angio/base/formatted.hpp"
#include "tip_filter.hpp"

namespace angio::localisation {

CatheterLocaliser::CatheterLocaliser(const LocaliserSettings& settings, const VesselTree& tree) {
  checkSettings("catheter localiser", settings);
  filter_ = std::make_shared<TipFilter>(settings, makePlaceGrid(tree, 1e-3 * settings.spacing_mm), tree.centroid());
  forget();
}

void CatheterLocaliser::forget() {
  seen_before_ = false;
  belief_ = filter_->summarised(filter_->probability());
}

TipBelief CatheterLocaliser::update(const TipEvidence& evidence, const CatheterMotion& motion) {
  filter_->predict(motion);
  const FrameOutcome outcome = filter_->observe(evidence);
  return adopt(outcome, motion, tipEndStd_m(evidence, filter_->summarised(filter_->probability()).tip));
}

TipBelief CatheterLocaliser::update(const SeenCatheter& seen, const SeenPose& pose, const CatheterMotion& motion) {
  filter_->predict(motion);
  return adopt(filter_->observe(seen, pose), motion);
}

TipBelief CatheterLocaliser::predict(const CatheterMotion& motion) {
  filter_->predict(motion);
  belief_ = filter_->summarised(filter_->probability());
  belief_.status = seen_before_ ? BeliefStatus::kPredicted : BeliefStatus::kUnknown;
  belief_.why = "no catheter is seen";
  return belief_;
}

void CatheterLocaliser::reset() {
  filter_->reset();
  forget();
}

void CatheterLocaliser::reset(int branch, double arc_m, double std_m) {
  filter_->reset(branch, arc_m, std_m);
  forget();
}

const TipBelief& CatheterLocaliser::adopt(const FrameOutcome& outcome, const CatheterMotion& motion, double end_std_m) {
  belief_ = filter_->summarised(filter_->probability());
  belief_.why = outcome.why;
  belief_.residual_px = outcome.residual_px;
  belief_.shift_px = outcome.shift_px;
  seen_before_ = seen_before_ || outcome.used;
  belief_.status = outcome.used          ? BeliefStatus::kSeen
                   : outcome.residual_px ? BeliefStatus::kLost
                   : seen_before_        ? BeliefStatus::kPredicted
                                         : BeliefStatus::kUnknown;
  const LocaliserSettings& settings = filter_->settings();
  if (end_std_m > 0) belief_.near_probability *= std::erf(1e-3 * settings.near_mm / (std::sqrt(2.0) * end_std_m));
  belief_.near_probability *= 1 - motion.fault_probability;
  if (outcome.used && belief_.near_probability < settings.min_probability) {
    belief_.status = BeliefStatus::kUnsure;
    belief_.why = formatted("the tip is within %.1f mm of its place with a probability of %.2f only", settings.near_mm,
                            belief_.near_probability);
  }
  return belief_;
}

Eigen::Vector3d tipOnRay(const TipPlace& place, const SeenCatheter& seen, const SeenPose& pose) {
  if (seen.tip_end != TipEnd::kLast || seen.points_px.cols() == 0) return place.tip_model;
  const Eigen::Vector3d ray = pose.camera.ray(seen.points_px.rightCols<1>()).normalized();
  const Eigen::Vector3d on_axis = pose.T_camera_model * place.tip_model;
  return pose.T_camera_model.inverse() * Eigen::Vector3d(ray.dot(on_axis) * ray);
}

}  // namespace angio::localisation

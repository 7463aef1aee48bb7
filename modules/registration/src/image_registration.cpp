// SPDX-License-Identifier: GPL-2.0-or-later
#include "image_registration.hpp"

#include "angio/base/stopwatch.hpp"
#include "angio/registration/alignment_score.hpp"
#include "fit_classification.hpp"
#include "image_gradient.hpp"
#include "image_needed.hpp"
#include "nearest_covariance.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {
namespace {

std::vector<cv::Mat> attenuationsOf(const XrayViews& views) {
  std::vector<cv::Mat> attenuations;
  for (const XrayView& view : views) attenuations.push_back(vesselAttenuation(*view.image));
  return attenuations;
}

}  // namespace

ImageRegistration::ImageRegistration(const char* name, const VesselTree& tree)
    : name_(name), tree_(tree), points_centered_(tree.points().colwise() - tree.centroid()) {}

RegistrationResult ImageRegistration::align(const XrayViews& views, const PosePrior&, const Pose& start) {
  requireImages(views, name_);
  const Stopwatch began;
  RegistrationResult result = resultAt(start, tree_.size(), views);
  result.prior = PriorInForce::kNone;  // Nothing holds the pose at its start, and the covariance counts nothing.
  if (tooFewPoints(result)) return result;
  const std::vector<cv::Mat> own = prepared_ ? std::vector<cv::Mat>() : attenuationsOf(views);
  result.times.prepare_s = began.seconds();

  const Stopwatch rigid_began;
  const Eigen::Translation3d to_center(tree_.centroid());
  Pose T_camera_centered = start * to_center;
  fit(views, prepared_ ? *prepared_ : own, T_camera_centered, result);
  result.T_camera_model = T_camera_centered * to_center.inverse();
  result.times.rigid_s = rigid_began.seconds();
  result.covariance = covarianceAt(views, T_camera_centered);
  result.alignment = alignmentScore(tree_, tree_.points(), views, result.T_camera_model);
  classify(tree_, result);
  result.times.total_s = began.seconds();
  return result;
}

RegistrationResult ImageRegistration::search(const XrayViews& views, const PosePrior& prior,
                                             const StartSettings& starts, const SearchProgress& progress) {
  requireImages(views, name_);
  const Stopwatch began;
  const std::vector<cv::Mat> attenuations = attenuationsOf(views);
  const double prepare_s = began.seconds();
  struct Held {  // Until the search ends, whichever way.
    const std::vector<cv::Mat>*& prepared;
    ~Held() { prepared = nullptr; }
  } held{prepared_};
  prepared_ = &attenuations;
  RegistrationResult result = Registration::search(views, prior, starts, progress);
  result.times.prepare_s += prepare_s;
  result.times.total_s += prepare_s;
  return result;
}

std::optional<Matrix6d> ImageRegistration::covarianceAt(const XrayViews& views, const Pose& T_camera_centered) const {
  return covarianceByNearest(points_centered_, views, T_camera_centered, PosePriorTerm{T_camera_centered},
                             tree_.centroid());
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "fit_uncertainty.hpp"

#include <algorithm>
#include <cmath>

#include "fit_classification.hpp"

namespace angio::registration {
namespace {

constexpr int kSpreadPoints = 32;

PlaceSpread spreadOf(const TreeError& error, const Eigen::Matrix3Xd& points_centered, const Pose& T_camera_centered) {
  const Eigen::Matrix3d R_model_camera = T_camera_centered.linear().transpose();
  PlaceSpread sums_m2;
  int count = 0;
  const Eigen::Index stride = std::max<Eigen::Index>(1, points_centered.cols() / kSpreadPoints);
  for (Eigen::Index i = stride / 2; i < points_centered.cols(); i += stride, ++count) {
    const Eigen::Vector3d at = points_centered.col(i);
    const Eigen::Matrix3d all = error.pointCovariance(at);
    const Eigen::Vector3d ray = R_model_camera * (T_camera_centered * at).normalized();
    sums_m2.noise_m += error.pointNoise(at).trace();
    sums_m2.all_m += all.trace();
    sums_m2.across_m += all.trace() - ray.dot(all * ray);
  }
  const auto rms = [&](double sum_m2) { return std::sqrt(std::max(0.0, sum_m2 / std::max(1, count))); };
  return {rms(sums_m2.noise_m), rms(sums_m2.all_m), rms(sums_m2.across_m)};
}

class FitUncertainty final : public PointUncertainty {
 public:
  FitUncertainty(std::shared_ptr<const TreeError> error, const Eigen::Matrix3d& R_camera_model,
                 const Eigen::Vector3d& centroid)
      : error_(std::move(error)), R_(R_camera_model), centroid_(centroid) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override {
    return R_ * error_->pointCovariance(p_model - centroid_) * R_.transpose();
  }

 private:
  std::shared_ptr<const TreeError> error_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d centroid_;
};

}  // namespace

void setUncertainty(const std::shared_ptr<const TreeError>& error, const Eigen::Matrix3Xd& points_centered,
                    const Pose& T_camera_centered, const Eigen::Vector3d& centroid, RegistrationResult& result) {
  result.covariance = covarianceOfResult(error->twistCovariance(), result.T_camera_model, centroid);
  result.noise_covariance = covarianceOfResult(error->noiseCovariance(), result.T_camera_model, centroid);
  result.deformation_std_m = error->amplitude_m();
  result.spread = spreadOf(*error, points_centered, T_camera_centered);
  result.points = std::make_shared<FitUncertainty>(error, T_camera_centered.linear(), centroid);
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "fit_uncertainty.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fit_classification.hpp"

namespace angio::registration {
namespace {

constexpr int kSpreadPoints = 32;

// Of one place, model axes.
class PlaceError {
 public:
  PlaceError(std::shared_ptr<const TreeError> error, std::shared_ptr<const LocalMisfit> misfit)
      : error_(std::move(error)), misfit_(std::move(misfit)) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& at) const {
    Eigen::Matrix3d covariance = error_->pointCovariance(at);
    if (misfit_) covariance += misfit_->covarianceAt(at);
    return covariance;
  }
  Eigen::Matrix3d noiseAt(const Eigen::Vector3d& at) const { return error_->pointNoise(at); }

 private:
  std::shared_ptr<const TreeError> error_;
  std::shared_ptr<const LocalMisfit> misfit_;
};

PlaceSpread spreadOf(const PlaceError& error, const Eigen::Matrix3Xd& points_centered, const Pose& T_camera_centered) {
  const Eigen::Matrix3d R_model_camera = T_camera_centered.linear().transpose();
  PlaceSpread sums_m2;
  int count = 0;
  const Eigen::Index stride = std::max<Eigen::Index>(1, points_centered.cols() / kSpreadPoints);
  for (Eigen::Index i = stride / 2; i < points_centered.cols(); i += stride, ++count) {
    const Eigen::Vector3d at = points_centered.col(i);
    const Eigen::Matrix3d all = error.covarianceAt(at);
    const Eigen::Vector3d ray = R_model_camera * (T_camera_centered * at).normalized();
    sums_m2.noise_m += error.noiseAt(at).trace();
    sums_m2.all_m += all.trace();
    sums_m2.across_m += all.trace() - ray.dot(all * ray);
  }
  const auto rms = [&](double sum_m2) { return std::sqrt(std::max(0.0, sum_m2 / std::max(1, count))); };
  return {rms(sums_m2.noise_m), rms(sums_m2.all_m), rms(sums_m2.across_m)};
}

class FitUncertainty final : public PointUncertainty {
 public:
  FitUncertainty(PlaceError error, const Eigen::Matrix3d& R_camera_model, const Eigen::Vector3d& centroid)
      : error_(std::move(error)), R_(R_camera_model), centroid_(centroid) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override {
    return R_ * error_.covarianceAt(p_model - centroid_) * R_.transpose();
  }

 private:
  PlaceError error_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d centroid_;
};

}  // namespace

void setUncertainty(const std::shared_ptr<const TreeError>& error, const Eigen::Matrix3Xd& points_centered,
                    const Pose& T_camera_centered, const Eigen::Vector3d& centroid, RegistrationResult& result,
                    std::shared_ptr<const LocalMisfit> misfit) {
  result.covariance = covarianceOfResult(error->twistCovariance(), result.T_camera_model, centroid);
  result.noise_covariance = covarianceOfResult(error->noiseCovariance(), result.T_camera_model, centroid);
  result.deformation_std_m = error->amplitude_m();
  const PlaceError places(error, std::move(misfit));
  result.spread = spreadOf(places, points_centered, T_camera_centered);
  result.points = std::make_shared<FitUncertainty>(places, T_camera_centered.linear(), centroid);
}

}  // namespace angio::registration

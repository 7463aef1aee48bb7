// SPDX-License-Identifier: GPL-2.0-or-later
#include "fit_uncertainty.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {
namespace {

constexpr int kSpreadPoints = 32;

}  // namespace

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

}  // namespace angio::registration

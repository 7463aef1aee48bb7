// SPDX-License-Identifier: GPL-2.0-or-later
#include "same_place.hpp"

#include <cmath>

namespace angio::registration {
namespace {

constexpr double kMaxAcross_m = 3e-3, kMaxDepthStds = 3, kMaxOfRelief = 1;

double rms(const Eigen::ArrayXd& values) { return std::sqrt(values.square().mean()); }

}  // namespace

bool isSamePlace(const Eigen::Matrix3Xd& here, const Eigen::Matrix3Xd& there, bool single_view, double depth_std_m) {
  if (here.cols() == 0) return false;
  const Eigen::Matrix3Xd apart = there - here;
  const Eigen::ArrayXd depth_m = here.colwise().norm().transpose();
  const Eigen::ArrayXd along_m = apart.cwiseProduct(here).colwise().sum().transpose().array() / depth_m;
  const Eigen::ArrayXd across_m =
      (apart.colwise().squaredNorm().transpose().array() - along_m.square()).max(0.0).sqrt();
  // Written so that what is not finite is no same place.
  if (!(rms(across_m) <= kMaxAcross_m)) return false;
  if (!single_view) return rms(along_m) <= kMaxDepthStds * depth_std_m;
  return rms(along_m - along_m.mean()) <= kMaxOfRelief * rms(depth_m - depth_m.mean());
}

}  // namespace angio::registration

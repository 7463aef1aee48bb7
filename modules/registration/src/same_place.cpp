// SPDX-License-Identifier: GPL-2.0-or-later
#include "same_place.hpp"

#include <cmath>

namespace angio::registration {
namespace {

constexpr double kApartAcross_m = 3e-3, kApartStds = 3, kApartOfRelief = 1;

double rootMeanSquare(const Eigen::ArrayXd& values) { return std::sqrt(values.square().mean()); }

}  // namespace

bool isSamePlace(const Eigen::Matrix3Xd& here, const Eigen::Matrix3Xd& there, bool single_view, double depth_std_m) {
  if (here.cols() == 0) return false;
  const Eigen::Matrix3Xd apart = there - here;
  const Eigen::ArrayXd depth_m = here.colwise().norm().transpose();
  const Eigen::ArrayXd along_m = apart.cwiseProduct(here).colwise().sum().transpose().array() / depth_m;
  const Eigen::ArrayXd across_m =
      (apart.colwise().squaredNorm().transpose().array() - along_m.square()).max(0.0).sqrt();
  // Written so that what is not finite is no same place.
  if (!(rootMeanSquare(across_m) <= kApartAcross_m)) return false;
  if (!single_view) return rootMeanSquare(along_m) <= kApartStds * depth_std_m;
  return rootMeanSquare(along_m - along_m.mean()) <= kApartOfRelief * rootMeanSquare(depth_m - depth_m.mean());
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "centerline_samples.hpp"

#include <algorithm>

#include "angio/vessel/resample.hpp"

namespace angio::servo {
namespace {

constexpr int kPlacesPerSample = 12;  // To choose from.
constexpr int kMaxPlaces = 20000;

}  // namespace

Eigen::Matrix3Xd spreadSamples(const VesselTree& tree, int count) {
  const double step_m = tree.length() / (kPlacesPerSample * count);
  const ResampledTree dense = resampled(tree, step_m, std::max(kMaxPlaces, tree.size()));
  const Eigen::Matrix3Xd& places = dense.tree.points();
  const auto samples = std::min<Eigen::Index>(count, places.cols());
  Eigen::Matrix3Xd chosen(3, samples);
  Eigen::Index next = 0;
  (places.colwise() - tree.centroid()).colwise().squaredNorm().maxCoeff(&next);
  Eigen::RowVectorXd nearest = Eigen::RowVectorXd::Constant(places.cols(), std::numeric_limits<double>::infinity());
  for (Eigen::Index i = 0; i < samples; ++i) {
    chosen.col(i) = places.col(next);
    nearest = nearest.cwiseMin((places.colwise() - places.col(next)).colwise().squaredNorm());
    nearest.maxCoeff(&next);
  }
  return chosen;
}

}  // namespace angio::servo

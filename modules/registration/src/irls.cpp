// SPDX-License-Identifier: GPL-2.0-or-later
#include "irls.hpp"

#include <algorithm>
#include <cmath>

namespace angio::registration {
namespace {

double kernelWeight(const IterativePnpSettings& settings, double distance2_px2, double scale_px) {
  switch (settings.kernel) {
    case Kernel::kGaussian:
      return std::exp(-distance2_px2 / (2 * scale_px * scale_px));
    case Kernel::kHuber: {
      const double distance_px = std::sqrt(distance2_px2);
      return distance_px <= settings.huber_px ? 1.0 : settings.huber_px / distance_px;
    }
    case Kernel::kL2:
      break;
  }
  return 1.0;
}

}  // namespace

void matchNearest(const Projected& projected, const PointMatcher& image, Pull& pull) {
  double largest2 = 0;
  for (std::size_t i = 0; i < pull.nearest.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (!projected.may_pull[i] || image.size() == 0) {
      pull.weight[k] = 0;
      pull.nearest[i] = -1;
      continue;
    }
    const auto match = image.nearest(projected.pixel.col(k), pull.nearby[i]);
    pull.nearest[i] = match.index;
    pull.target_px.col(k) = image.point(match.index);
    pull.weight[k] = 1;
    largest2 = std::max(largest2, match.distance2_px2);
  }
  pull.max_distance_px = std::sqrt(largest2);
}

void weigh(const Projected& projected, const PointMatcher& image, const std::vector<int>& branch,
           const IterativePnpSettings& settings, double scale_px, Pull& pull) {
  pull.weighted_squares_px2 = 0;
  const int each_side = branch.empty() ? 0 : settings.neighbours_each_side;
  for (std::size_t i = 0; i < pull.nearest.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const int nearest = pull.nearest[i];
    if (nearest < 0) continue;
    const Eigen::Vector2d pixel = projected.pixel.col(k);
    const double distance2 = (pixel - image.point(nearest)).squaredNorm();
    double sum = kernelWeight(settings, distance2, scale_px);
    Eigen::Vector2d weighted = sum * image.point(nearest);
    const int first = std::max(0, nearest - each_side), last = std::min(image.size() - 1, nearest + each_side);
    for (int j = first; j <= last; ++j) {
      if (j == nearest || branch[static_cast<std::size_t>(j)] != branch[static_cast<std::size_t>(nearest)]) continue;
      const double w = kernelWeight(settings, (pixel - image.point(j)).squaredNorm(), scale_px);
      sum += w;
      weighted += w * image.point(j);
    }
    pull.weight[k] = sum;
    pull.weighted_squares_px2 += sum * distance2;
    // A weight that has underflowed pulls nowhere.
    if (sum > 0) pull.target_px.col(k) = weighted / sum;
  }
}

}  // namespace angio::registration

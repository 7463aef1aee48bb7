// SPDX-License-Identifier: GPL-2.0-or-later
#include "followed_path.hpp"

#include <Eigen/Core>
#include <algorithm>

namespace angio {
namespace {

constexpr int kMostPoints = 16;
constexpr int kSweeps = 60;  // Of eight unknowns: to a thousandth of a period's way.

}  // namespace

double followingVelocity(const std::vector<PathPoint>& path, double velocity, double period_s, double most_change,
                         double effort) {
  const int n = std::min(static_cast<int>(path.size()), kMostPoints);
  if (n == 0) return 0;
  // Of the changes c_i at the begin of each period: place_k = period (k v + sum over i <= k of (k - i + 1) c_i).
  Eigen::Matrix<double, kMostPoints, kMostPoints> H;
  Eigen::Matrix<double, kMostPoints, 1> g, change;
  change.setZero();
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      H(i, j) = i == j ? effort : 0;
      for (int k = std::max(i, j); k < n; ++k)
        H(i, j) += path[static_cast<std::size_t>(k)].weight * (k - i + 1) * (k - j + 1);
    }
    g[i] = 0;
    for (int k = i; k < n; ++k) {
      const PathPoint& point = path[static_cast<std::size_t>(k)];
      g[i] += point.weight * (k - i + 1) * (point.place / period_s - (k + 1) * velocity);
    }
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (int i = 0; i < n; ++i) {
      double left = g[i];
      for (int j = 0; j < n; ++j) {
        if (j != i) left -= H(i, j) * change[j];
      }
      change[i] = H(i, i) > 0 ? std::clamp(left / H(i, i), -most_change, most_change) : 0;
    }
  }
  return velocity + change[0];
}

}  // namespace angio

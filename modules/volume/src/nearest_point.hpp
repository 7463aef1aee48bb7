// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <nanoflann.hpp>

#include "angio/volume/namespace.hpp"

namespace angio::volume {

/// Nearest of many points, by a k-d tree.
class NearestPoint {
 public:
  /// Takes 3 x N points, N > 0.
  explicit NearestPoint(Eigen::Matrix3Xd points) : points_(std::move(points)), tree_(3, points_) {}
  NearestPoint(const NearestPoint&) = delete;
  NearestPoint& operator=(const NearestPoint&) = delete;

  struct Found {
    std::size_t index = 0;
    double distance = 0;
  };

  Found find(const Eigen::Vector3d& query) const {
    Eigen::Index index = 0;
    double square = 0;
    tree_.index->knnSearch(query.data(), 1, &index, &square);
    return {static_cast<std::size_t>(index), std::sqrt(square)};
  }
  double distance(const Eigen::Vector3d& query) const { return find(query).distance; }

 private:
  Eigen::Matrix3Xd points_;
  nanoflann::KDTreeEigenMatrixAdaptor<Eigen::Matrix3Xd, 3, nanoflann::metric_L2_Simple, false> tree_;
};

}  // namespace angio::volume

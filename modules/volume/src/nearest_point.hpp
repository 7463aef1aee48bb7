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
  explicit NearestPoint(Eigen::Matrix3Xd points) : points_(std::move(points)), index_(3, *this, {10}) {
    index_.buildIndex();
  }
  NearestPoint(const NearestPoint&) = delete;
  NearestPoint& operator=(const NearestPoint&) = delete;

  struct Found {
    std::size_t index = 0;
    double distance = 0;
  };

  Found find(const Eigen::Vector3d& query) const {
    std::uint32_t index = 0;
    double square = 0;
    index_.knnSearch(query.data(), 1, &index, &square);
    return {index, std::sqrt(square)};
  }
  double distance(const Eigen::Vector3d& query) const { return find(query).distance; }

  // What nanoflann asks for.
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points_.cols()); }
  double kdtree_get_pt(std::size_t i, std::size_t k) const {
    return points_(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i));
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }

 private:
  using Metric = nanoflann::L2_Simple_Adaptor<double, NearestPoint>;
  Eigen::Matrix3Xd points_;
  nanoflann::KDTreeSingleIndexAdaptor<Metric, NearestPoint, 3, std::uint32_t> index_;
};

}  // namespace angio::volume

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <functional>
#include <nanoflann.hpp>
#include <utility>
#include <vector>

#include "angio/evaluation/namespace.hpp"

namespace angio::evaluation {

/// Which points of an image are near a place.
class NearPlaces {
 public:
  using Found = std::vector<std::pair<Eigen::Index, double>>;  ///< Which point, and its squared distance.

  explicit NearPlaces(const Eigen::Matrix2Xd& points_px)
      : rows_(points_px.transpose()), tree_(2, std::cref(rows_), 10) {}

  /// Those nearer than `reach_px`, in no order. Valid until the next call.
  const Found& within(const Eigen::Vector2d& place_px, double reach_px) {
    constexpr bool kSorted = false;
    tree_.index->radiusSearch(place_px.data(), reach_px * reach_px, found_, nanoflann::SearchParams(32, 0, kSorted));
    return found_;
  }

 private:
  Eigen::MatrixX2d rows_;
  nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX2d, 2> tree_;
  Found found_;
};

}  // namespace angio::evaluation

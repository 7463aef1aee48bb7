// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <vector>

#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Nearest image points, by a k-d tree on the static 2D side (paper, section III-C). For one thread.
class PointMatcher {
 public:
  explicit PointMatcher(const Eigen::Matrix2Xd& points_px) : points_(points_px), index_(2, *this, {10}) {
    index_.buildIndex();
  }
  PointMatcher(const PointMatcher&) = delete;
  PointMatcher& operator=(const PointMatcher&) = delete;

  struct Match {
    int index = -1;
    double distance2_px2 = 0;
  };

  /// What is kept of one query's search, so that the next search near it is a look at a few candidates.
  struct Nearby {
    static constexpr int kMaxCount = 24;
    Eigen::Vector2d anchor{0, 0};  // Where the search was made.
    int count = 0;                 // 0: nothing is known.
    int nearest = -1;
    std::array<int, kMaxCount> candidates;
  };

  /// The nearest point, exactly: while a query stays within kReach of where it was searched, its
  /// nearest point is among those that were at most 2 kReach further away than the nearest one then (triangle
  /// inequality).
  Match nearest(const Eigen::Vector2d& query, Nearby& nearby) const {
    if (nearby.count == 0 || (query - nearby.anchor).squaredNorm() > kReach_px * kReach_px)
      return search(query, nearby);
    Match best{-1, std::numeric_limits<double>::max()};
    for (int c = 0; c < nearby.count; ++c) {
      const int i = nearby.candidates[static_cast<std::size_t>(c)];
      const double distance2 = (points_.col(i) - query).squaredNorm();
      if (distance2 < best.distance2_px2) best = {i, distance2};
    }
    nearby.nearest = best.index;
    return best;
  }

  int size() const { return static_cast<int>(points_.cols()); }
  Eigen::Vector2d point(int index) const { return points_.col(index); }

  // What nanoflann asks of a data set.
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points_.cols()); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points_(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(i));
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }

 private:
  static constexpr double kReach_px = 0.8;

  // nanoflann's result set that keeps all points up to 2 kReach further away than the nearest.
  struct NearestAndNext {
    using DistanceType = double;
    using IndexType = std::uint32_t;
    std::vector<Match>& found;
    Match best{-1, std::numeric_limits<double>::max()};
    double reach2_px2 = std::numeric_limits<double>::max();
    bool full() const { return true; }
    std::size_t size() const { return found.size(); }
    double worstDist() const { return reach2_px2; }
    bool addPoint(double distance2, std::uint32_t index) {
      if (distance2 > reach2_px2) return true;
      found.push_back({static_cast<int>(index), distance2});
      if (distance2 < best.distance2_px2) {
        best = found.back();
        const double reach = std::sqrt(distance2) + 2 * kReach_px;
        reach2_px2 = reach * reach;
      }
      return true;
    }
  };

  Match search(const Eigen::Vector2d& query, Nearby& nearby) const {
    found_.clear();
    NearestAndNext result{found_};
    // The last match bounds the search.
    if (nearby.nearest >= 0) {
      const double reach = (points_.col(nearby.nearest) - query).norm() + 2 * kReach_px;
      result.reach2_px2 = reach * reach;
    }
    index_.findNeighbors(result, query.data(), nanoflann::SearchParams());
    nearby.anchor = query;
    nearby.nearest = result.best.index;
    nearby.count = 0;
    for (const Match& match : found_) {
      if (match.distance2_px2 > result.reach2_px2) continue;
      if (nearby.count == Nearby::kMaxCount) {  // Too many to keep: the next search is a full one.
        nearby.count = 0;
        break;
      }
      nearby.candidates[static_cast<std::size_t>(nearby.count++)] = match.index;
    }
    return result.best;
  }

  using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointMatcher>, PointMatcher, 2,
                                                    std::uint32_t>;

  Eigen::Matrix2Xd points_;
  Index index_;
  mutable std::vector<Match> found_;
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>

#include "angio/evaluation/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::evaluation {

/// Lengths are counted at points so far apart [px].
inline constexpr double kScoreStep_px = 1;

/// The nearest place on a centreline, exact on its segments.
class NearestOnCurve {
 public:
  struct Place {
    double distance_px = std::numeric_limits<double>::infinity();
    double tangent_rad = 0, radius_px = 0;
  };

  explicit NearestOnCurve(const Centerline2d& curve)
      : curve_(densified(curve, kScoreStep_px)), rows_(curve_.points_px.transpose()), tree_(2, std::cref(rows_), 10) {}

  Place operator()(const Eigen::Vector2d& q) const {
    Place best;
    if (curve_.size() == 0) return best;
    // The nearest segment ends at one of the nearest points: its points stand a pixel apart.
    constexpr int kNearest = 4;
    Eigen::Index index[kNearest];
    double distance2[kNearest];
    const std::size_t found = tree_.index->knnSearch(q.data(), kNearest, index, distance2);
    for (std::size_t k = 0; k < found; ++k) {
      offer(q, index[k], index[k], best);
      if (joined(index[k] - 1, index[k])) offer(q, index[k] - 1, index[k], best);
      if (joined(index[k], index[k] + 1)) offer(q, index[k], index[k] + 1, best);
    }
    return best;
  }

 private:
  bool joined(Eigen::Index a, Eigen::Index b) const {
    return curve_.ordered() && a >= 0 && b < curve_.size() && curve_.branch[a] == curve_.branch[b];
  }

  void offer(const Eigen::Vector2d& q, Eigen::Index a, Eigen::Index b, Place& best) const {
    const Eigen::Vector2d from = curve_.points_px.col(a), along = curve_.points_px.col(b) - from;
    const double length2 = along.squaredNorm();
    const double t = length2 > 0 ? std::clamp((q - from).dot(along) / length2, 0.0, 1.0) : 0;
    const double distance_px = (from + t * along - q).norm();
    if (distance_px < best.distance_px) {
      best = {distance_px, length2 > 0 ? std::atan2(along.y(), along.x()) : curve_.tangent_rad[a],
              curve_.radius_px.size() > 0 ? curve_.radius_px[a] : 0};
    }
  }

  using Tree = nanoflann::KDTreeEigenMatrixAdaptor<Eigen::MatrixX2d, 2>;
  Centerline2d curve_;
  Eigen::MatrixX2d rows_;
  Tree tree_;
};

}  // namespace angio::evaluation

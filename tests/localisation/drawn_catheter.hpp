// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "angio/localisation/catheter_localiser.hpp"
#include "angio/test/namespace.hpp"
#include "angio/vessel/tree_topology.hpp"

namespace angio::test {

/// A catheter drawn into the image: the tree's centreline from its root to a tip, every 4 px or less, as far as the
/// detector sees it.
inline SeenCatheter drawnCatheter(const TreeTopology& map, const TreeLocation& tip, const SeenPose& pose,
                                  const Eigen::Vector2d& shift_px = Eigen::Vector2d::Zero()) {
  std::vector<Eigen::Vector2d> line;
  for (const int branch : map.pathTo(tip.branch)) {
    const double end_m = branch == tip.branch ? tip.arc_m : map.length_m(branch);
    const int steps = std::max(1, static_cast<int>(std::ceil(end_m / 0.5e-3)));
    for (int k = 0; k <= steps; ++k) {
      const auto u = pose.camera.project(pose.T_camera_model * map.point({branch, end_m * k / steps}));
      if (!u || !pose.camera.sees(*u + shift_px)) continue;
      if (line.empty() || (*u + shift_px - line.back()).norm() > 1e-9) line.push_back(*u + shift_px);
    }
  }
  SeenCatheter seen;
  seen.points_px.resize(2, static_cast<Eigen::Index>(line.size()));
  for (std::size_t i = 0; i < line.size(); ++i) seen.points_px.col(static_cast<Eigen::Index>(i)) = line[i];
  return seen;
}

/// The same with white noise and a smooth sideways deviation (a catheter does not lie in the middle of its vessel).
inline SeenCatheter noisy(SeenCatheter seen, double white_px, double smooth_px, std::mt19937& random) {
  std::normal_distribution<double> normal;
  double walked = 0;
  const Eigen::Vector2d a(normal(random), normal(random)), b(normal(random), normal(random));
  for (Eigen::Index i = 0; i < seen.points_px.cols(); ++i) {
    if (i > 0) walked += (seen.points_px.col(i) - seen.points_px.col(i - 1)).norm();
    const Eigen::Vector2d smooth = smooth_px * (a * std::sin(walked / 25) + b * std::cos(walked / 25)) / std::sqrt(2.0);
    seen.points_px.col(i) += smooth + white_px * Eigen::Vector2d(normal(random), normal(random));
  }
  return seen;
}

}  // namespace angio::test

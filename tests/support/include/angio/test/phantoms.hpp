// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <string>

#include "angio/geometry/carm.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::test {

inline std::string exampleData(const std::string& name) { return std::string(ANGIO_EXAMPLE_DATA) + "/" + name; }

/// A branching tree of about 100 mm: curved branches that split in two, five generations deep, 1 mm between points.
/// No two seeds give the same tree. Centred near `centre_m`.
inline VesselTree branchingTree(unsigned seed, const Eigen::Vector3d& center_m = Eigen::Vector3d::Zero()) {
  Random random(seed);
  std::vector<Eigen::Vector3d> points;
  std::vector<int> parents;
  std::vector<std::optional<double>> radii;
  const std::function<void(int, Eigen::Vector3d, Eigen::Vector3d, int)> grow =
      [&](int parent, Eigen::Vector3d at, Eigen::Vector3d direction, int generation) {
        const Eigen::Vector3d bend = random.vector(0.02);
        const int steps = 40 - 4 * generation;
        for (int i = 0; i < steps; ++i) {
          direction = (direction + bend + random.vector(0.02)).normalized();
          at += 1e-3 * direction;
          points.push_back(at);
          parents.push_back(parent);
          radii.push_back(2.5e-3 * std::pow(0.75, generation));
          parent = static_cast<int>(points.size()) - 1;
        }
        if (generation == 4) return;
        const Eigen::Vector3d side = direction.cross(random.direction()).normalized();
        grow(parent, at, (direction + 0.7 * side).normalized(), generation + 1);
        grow(parent, at, (direction - 0.7 * side).normalized(), generation + 1);
      };
  points.push_back(center_m - Eigen::Vector3d(0, 0.06, 0));
  parents.push_back(-1);
  radii.push_back(2.5e-3);
  grow(0, points.front(), Eigen::Vector3d::UnitY(), 0);
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return VesselTree(matrix, parents, radii);
}

/// A pose that a C-arm's view would have: any orientation, the tree's centre 750 mm from the source.
inline Pose viewOf(const VesselTree& tree, Random& random) {
  Pose T = Pose::Identity();
  const double angle_rad =
      random.uniform(0, 3);  // In a statement of its own: so every compiler draws in the same order.
  T.linear() = expSO3(angle_rad * random.direction());
  T.translation() = Eigen::Vector3d(0, 0, 0.75) - T.linear() * tree.centroid();
  return T;
}

/// `T_camera_model` turned and shifted about the tree's centre, in the tree's own axes.
inline Pose perturbed(const Pose& T_camera_model, const VesselTree& tree, const Twist& xi) {
  const Eigen::Translation3d to_center(tree.centroid());
  return T_camera_model * to_center * expSE3(xi) * to_center.inverse();
}

/// 1024 x 1024 pixels of 0.308 mm, 1.2 m from the source.
inline XrayCamera clinicalCamera() { return XrayCamera::centered(1024, 1024, 0.308e-3, 1.2); }

}  // namespace angio::test

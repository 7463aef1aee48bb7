// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "angio/registration/certificate.hpp"
#include "pose_bounds.hpp"
#include "pose_comparison.hpp"

namespace angio::registration {

/// No pose has the tree's centroid nearer to the source.
constexpr double kNearest_m = 0.01;

/// The poses of a certificate: rotation vector about the centroid from the box's middle, the centroid's ray and depth.
struct PoseCoordinates {
  Eigen::Vector3d rotation;
  double ray_x, ray_y, depth;
};

/// The box, in which coordinates a pose is, and which poses are the found one.
class CertificateBox {
 public:
  CertificateBox(const VesselTree& tree, const TreeSamples& samples, const Pose& center, const Pose& found,
                 const CertificateSettings& settings)
      : center_(center * Eigen::Translation3d(tree.centroid())),
        found_(found * Eigen::Translation3d(tree.centroid())),
        half_turn_(degToRad(settings.box_rotation_deg)),
        half_shift_m_(1e-3 * settings.box_translation_mm),
        distance_m_(1e-3 * settings.distance_mm),
        spread_(samples.points * samples.points.transpose() / TreeSamples::kCount),
        found_ray_(found_.translation().head<2>() / found_.translation().z()) {}

  const Pose& center() const { return center_; }
  const Pose& found() const { return found_; }
  /// Half the extent about and along each axis of the camera [rad], [m].
  Eigen::Vector3d halfTurns() const { return half_turn_ * center_.linear().cwiseAbs().rowwise().sum(); }
  Eigen::Vector3d halfExtent() const { return half_shift_m_ * center_.linear().cwiseAbs().rowwise().sum(); }

  Pose pose(const PoseCoordinates& c) const {
    Pose T = Pose::Identity();
    T.linear() = expSO3(c.rotation) * center_.linear();
    T.translation() = c.depth * Eigen::Vector3d(c.ray_x, c.ray_y, 1);
    return T;
  }

  PoseCoordinates coordinates(const Pose& T) const {
    const Eigen::Vector3d& t = T.translation();
    return {logSO3(T.linear() * center_.linear().transpose()), t.x() / t.z(), t.y() / t.z(), t.z()};
  }

  /// The found pose with near and far exchanged.
  Pose mirrored() const { return depthMirrored(found_, eigenOfSymmetric(spread_).vectors.col(0)); }

  bool contains(const PoseCoordinates& c) const {
    if ((center_.linear().transpose() * c.rotation).cwiseAbs().maxCoeff() > half_turn_ || c.depth < kNearest_m)
      return false;
    const Eigen::Vector3d shift =
        center_.linear().transpose() * (c.depth * Eigen::Vector3d(c.ray_x, c.ray_y, 1) - center_.translation());
    return shift.cwiseAbs().maxCoeff() <= half_shift_m_;
  }

  /// Whether a cell's rotations are all outside the box.
  bool outside(const PoseCell& cell) const {
    const Eigen::Matrix3d to_model = center_.linear().transpose();
    return ((to_model * cell.rotation).cwiseAbs() - to_model.cwiseAbs() * cell.half).maxCoeff() > half_turn_ + 1e-9;
  }

  /// Whether a ray's cell at these depths has no pose of the box.
  bool outside(const PoseCell& cell, double ray_x, double ray_y, double half_ray) const {
    const Eigen::Vector3d shift =
        center_.linear().transpose() * (cell.depth * Eigen::Vector3d(ray_x, ray_y, 1) - center_.translation());
    const double sideways = half_ray * (cell.depth + cell.half_depth);
    const Eigen::Vector3d extent(sideways + std::abs(ray_x) * cell.half_depth,
                                 sideways + std::abs(ray_y) * cell.half_depth, cell.half_depth);
    const Eigen::Vector3d reach = center_.linear().transpose().cwiseAbs() * extent;
    return (shift.cwiseAbs() - reach).maxCoeff() > half_shift_m_ + 1e-9;
  }

  /// Distance from the found pose [m]: of the rotations, and of the centroid's rays at the found depth.
  double turned_m(const Eigen::Matrix3d& R) const {
    const Eigen::Matrix3d change = R - found_.linear();
    return std::sqrt(std::max(0.0, (change * spread_ * change.transpose()).trace()));
  }
  double shifted_m(double ray_x, double ray_y) const {
    return found_.translation().z() * std::hypot(ray_x - found_ray_.x(), ray_y - found_ray_.y());
  }
  double distance_m(const Pose& T) const {
    return std::hypot(turned_m(T.linear()),
                      shifted_m(T.translation().x() / T.translation().z(), T.translation().y() / T.translation().z()));
  }
  bool isFound(const Pose& T) const { return distance_m(T) <= distance_m_; }

  /// Whether all poses of a cell are the found one; `max_turn_m` is the most that its rotations are turned.
  bool isFound(double max_turn_m, double ray_x, double ray_y, double half_ray) const {
    if (max_turn_m > distance_m_) return false;
    const double shifted = shifted_m(ray_x, ray_y) + std::sqrt(2.0) * half_ray * found_.translation().z();
    return std::hypot(max_turn_m, shifted) <= distance_m_ * (1 - 1e-9);
  }
  double maxTurn_m(const PoseCell& cell) const {
    return turned_m(expSO3(cell.rotation) * center_.linear()) + cell.half.norm() * std::sqrt(spread_.trace());
  }

 private:
  Pose center_, found_;
  double half_turn_, half_shift_m_, distance_m_;
  Eigen::Matrix3d spread_;
  Eigen::Vector2d found_ray_;
};

}  // namespace angio::registration

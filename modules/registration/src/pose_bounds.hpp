// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <cstdint>

#include "angio/vessel/vessel_tree.hpp"
#include "explained_raster.hpp"
#include "field_step.hpp"

namespace angio::registration {

/// Places of a tree with the direction of their vessel, about the tree's centroid.
struct TreeSamples {
  static constexpr int kCount = 256;  ///< A multiple of the lanes of any vector.

  /// kCount places evenly spaced along the tree, in an order in which each part of the list covers the tree.
  explicit TreeSamples(const VesselTree& tree);

  Eigen::Matrix3Xd points, tangents;  ///< 3 x kCount [m].
  ModelPoints floats;                 ///< The same; a weight is the distance from the centroid, rounded up.
};

/// Rotations exp(r) R0 with r within `half` of `rotation`, and depths of the centroid within `half_depth` of `depth`.
struct PoseCell {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero(), half = Eigen::Vector3d::Zero();  ///< [rad]
  double depth = 0, half_depth = 0;                                                    ///< [m]
};

/// Where the centroid's ray meets the plane z = 1, and how far it may be from there in x and in y.
struct RayCell {
  double x = 0, y = 0, half = 0;
};

/// A part of the image with sides along its axes [px].
struct ImageWindow {
  double u_min = 0, v_min = 0, u_max = 0, v_max = 0;

  bool contains(double u, double v) const { return u >= u_min && u <= u_max && v >= v_min && v <= v_max; }
};

/// Returns the part of a view's image in which the tree should be seen: the detector, or a window inside the
/// collimator's edges.
ImageWindow openWindow(const XrayView& view);

/// What a cell of poses makes of each sample, as vector code reads it.
struct BoundedSamples {
  static constexpr int kCount = TreeSamples::kCount;

  /// The position in cells of the sample's level is (u + u_per_ray ray_x, v + v_per_ray ray_y).
  float u[kCount], v[kCount], u_per_ray[kCount], v_per_ray[kCount], u_last[kCount], v_last[kCount];
  /// Where on its level the sample must be to be in the window in all poses.
  float u_seen[kCount], v_seen[kCount], u_seen_to[kCount], v_seen_to[kCount];
  std::int32_t first[kCount], columns[kCount];  ///< Of its level.
  std::uint32_t directions[kCount];
  std::int32_t unexplained;  ///< Points that a sample which is seen and not explained costs.
  double effects[5];         ///< Sums over the samples, see PoseBounds::effects_px.
};

/// Bounds of the score in all poses of a cell, in points.
///
/// A sample that the image explains has kExplained points, one that projects into the open window and is not explained
/// costs `unexplained` times as many, and one that is not seen has none.
class PoseBounds {
 public:
  static constexpr int kExplained = 1;

  /// Borrows samples and raster. `R0` is the rotation in the middle of all cells.
  PoseBounds(const TreeSamples& samples, const ExplainedRaster& raster, const XrayView& view, const Eigen::Matrix3d& R0,
             int unexplained = 1);

  /// For the bounds that follow: their rotations and depths, and rays of half width `half_ray` whose middles are in
  /// `rays`.
  void prepare(const PoseCell& cell, const RayCell& rays, double half_ray);

  /// Points that no pose with the prepared rotations and depths and a ray within half_ray of (x, y) exceeds; or -1 when
  /// they are less than `enough`.
  int pointsBound(double ray_x, double ray_y, int enough) const;

  /// How far in the image the prepared cell moves the samples on average, in u and v, by each of three rotations,
  /// depth, and the ray: of the ray half, which stands for two dimensions [px].
  const std::array<double, 5>& effects_px() const { return effects_px_; }

  /// Points of a pose; -1 when they are less than `enough`.
  int points(const Pose& T_camera_centered, int enough = 0) const;

  static constexpr int maxPoints() { return kExplained * TreeSamples::kCount; }

 private:
  const TreeSamples& samples_;
  const ExplainedRaster& raster_;
  XrayCamera camera_;
  ImageWindow window_;
  Eigen::Matrix3d R0_;
  int unexplained_;
  std::array<double, 5> effects_px_{};
  BoundedSamples bounded_{};
};

}  // namespace angio::registration

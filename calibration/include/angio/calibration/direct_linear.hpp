// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/calibration/namespace.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

using Matrix34d = Eigen::Matrix<double, 3, 4>;

/// A projection matrix taken apart: P ~ K [R | t].
struct ProjectionParts {
  Eigen::Matrix3d K;      ///< Upper triangular, K(2, 2) = 1, positive diagonal [px].
  Pose T_camera_model;    ///< [m]
  bool mirrored = false;  ///< The points in front of the camera are seen mirrored: K [-R | ...] fits, no pose.
};

/// The projection matrix P, of unit norm and with points in front of the camera, that explains correspondences best by
/// the normalised direct linear transform; nothing for fewer than 6 points, for points that lie in a plane or on
/// another surface that leaves P open, and when points come out on both sides of the camera.
///
/// @param points_m  3 x N. @param pixels_px  2 x N.
/// Source: Hartley and Zisserman, Multiple View Geometry (2004), algorithm 7.1.
std::optional<Matrix34d> directLinearTransform(const Eigen::Matrix3Xd& points_m, const Eigen::Matrix2Xd& pixels_px);

/// Takes P apart by RQ decomposition; P must see points with a positive third coordinate. When it is `mirrored`, K and
/// pose are those of the image mirrored in u about its origin.
ProjectionParts decomposed(const Matrix34d& P);

/// Where P puts points: 2 x N [px].
Eigen::Matrix2Xd projectedBy(const Matrix34d& P, const Eigen::Matrix3Xd& points_m);

/// The homography from a plane's x, y [m] to pixels by the normalised direct linear transform, of unit norm and with
/// the points in front; nothing for fewer than 4 points or points on a line. Source: the same, algorithm 4.2.
std::optional<Eigen::Matrix3d> directLinearHomography(const Eigen::Matrix2Xd& plane_m,
                                                      const Eigen::Matrix2Xd& pixels_px);

/// The projection that most points agree on, by the above over draws of few, and the numbers of those points.
struct AgreedProjection {
  Matrix34d P;
  std::vector<int> points;
};

/// Finds it for points that are within a tolerance of where P puts them; nothing when the points leave it open. Flat
/// ones lie at z = 0, which then counts for nothing.
std::optional<AgreedProjection> agreedProjection(const Eigen::Matrix3Xd& points_m, const Eigen::Matrix2Xd& pixels_px,
                                                 double tolerance_px, bool flat);

/// From where P puts a point to a pixel; infinity for a point behind the camera.
double distance_px(const Matrix34d& P, const Eigen::Vector3d& point_m, const Eigen::Vector2d& pixel_px);

/// The pose of the plane (z = 0) by its homography and K. Source: Zhang, A flexible new technique for
/// camera calibration, PAMI 22 (2000), section 3.1.
Pose planarPose(const Eigen::Matrix3d& homography, const Eigen::Matrix3d& K);

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "local_misfit.hpp"

#include <algorithm>
#include <cmath>

#include "bucket_grid.hpp"

namespace angio::registration {
namespace {

// Nearer than this a vessel has its image; further away than that the image says nothing of where it is.
constexpr double kSeen_px = 2, kMost_px = 15;
// Between undirected tangents of a vessel and of its image: as noisy ones pass, and most crossing vessels do not.
const double kMinCos2 = std::pow(std::cos(0.5), 2);
// A vessel that projects to less than a fifth of its length has no direction to disagree with.
constexpr double kEndOn2 = 0.04;
// Standard deviation of the weight of the points about a place.
constexpr double kAlong_m = 3e-3, kReach_m = 3 * kAlong_m;

// Directions of the vessels at the model's points, of any length.
Eigen::Matrix3Xd directionsOf(const OrientedModel& model, const Eigen::Matrix3Xd& displaced) {
  Eigen::Matrix3Xd along = Eigen::Matrix3Xd::Zero(3, displaced.cols());
  for (const auto& [parent, child] : model.edges) {
    const Eigen::Vector3d edge = displaced.col(child) - displaced.col(parent);
    for (const int i : {parent, child}) along.col(i) += (along.col(i).dot(edge) < 0 ? -1 : 1) * edge;
  }
  return along;
}

// The square of the distance to the nearest image point that runs along a direction [px^2], kMost_px at most.
double nearestAlong2_px2(const BucketGrid& grid, const Centerline2d& image, const Eigen::Vector2d& pixel,
                         const Eigen::Vector2d& direction, bool any_direction) {
  double nearest2_px2 = kMost_px * kMost_px;
  grid.eachWithin(pixel, kMost_px, [&](int j, double x, double y) {
    const double distance2_px2 = x * x + y * y;
    if (distance2_px2 >= nearest2_px2) return;
    const Eigen::Vector2d tangent(std::cos(image.tangent_rad[j]), std::sin(image.tangent_rad[j]));
    const double together = tangent.dot(direction);
    if (any_direction || together * together >= kMinCos2 * direction.squaredNorm()) nearest2_px2 = distance2_px2;
  });
  return nearest2_px2;
}

}  // namespace

LocalMisfit::LocalMisfit(const XrayViews& views, const OrientedModel& model, const Eigen::Matrix3Xd& displaced,
                         const Pose& T_camera_centered)
    : points_(model.points), covariance_m2_(Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, model.points.cols())) {
  const Eigen::Matrix3Xd along = directionsOf(model, displaced);
  BucketGrid grid;
  for (const XrayView& view : views) {
    if (view.centerline.size() == 0) continue;
    grid.build(view.centerline.points_px);
    const Pose T = view.T_view_first * T_camera_centered;
    for (Eigen::Index i = 0; i < points_.cols(); ++i) {
      const Eigen::Vector3d there = T * displaced.col(i);
      const auto pixel = view.camera.project(there);
      if (!pixel || !view.camera.sees(*pixel)) continue;
      const Eigen::Vector3d t = T.linear() * along.col(i);
      const Eigen::Vector2d direction = t.head<2>() - there.head<2>() * (t.z() / there.z());
      const bool end_on = direction.squaredNorm() < kEndOn2 * t.squaredNorm();
      const double off2_px2 = nearestAlong2_px2(grid, view.centerline, *pixel, direction, end_on) - kSeen_px * kSeen_px;
      if (off2_px2 <= 0) continue;
      const double pixel_m = there.z() / view.camera.parameters().fx_px;
      const Eigen::Vector3d beam = T.linear().transpose() * there.normalized();
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - beam * beam.transpose();
      Vector6d packed;
      packed << across(0, 0), across(0, 1), across(0, 2), across(1, 1), across(1, 2), across(2, 2);
      covariance_m2_.col(i) += off2_px2 * pixel_m * pixel_m * packed;
    }
  }
}

Eigen::Matrix3d LocalMisfit::covarianceAt(const Eigen::Vector3d& at) const {
  Vector6d sum = Vector6d::Zero();
  double weights = 0;
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    const double distance2_m2 = (points_.col(i) - at).squaredNorm();
    if (distance2_m2 > kReach_m * kReach_m) continue;
    const double weight = std::exp(-distance2_m2 / (2 * kAlong_m * kAlong_m));
    sum += weight * covariance_m2_.col(i);
    weights += weight;
  }
  if (!(weights > 0)) return Eigen::Matrix3d::Zero();
  sum /= weights;
  Eigen::Matrix3d covariance_m2;
  covariance_m2 << sum[0], sum[1], sum[2], sum[1], sum[3], sum[4], sum[2], sum[4], sum[5];
  return covariance_m2;
}

}  // namespace angio::registration

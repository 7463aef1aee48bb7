// SPDX-License-Identifier: GPL-2.0-or-later
#include "local_misfit.hpp"

#include <algorithm>
#include <cmath>

#include "angio/geometry/bucket_grid.hpp"
#include "angio/registration/alignment_score.hpp"

namespace angio::registration {
namespace {

// Nearer than this a vessel has its image; further away than that the image says nothing of where it is.
constexpr double kSeen_px = 2, kMost_px = 15;
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

// A view's image points, for what is near and runs alike.
class DirectedImage {
 public:
  explicit DirectedImage(const Centerline2d& image) : tangents_(2, image.size()) {
    grid_.build(image.points_px);
    tangents_.row(0) = image.tangent_rad.array().cos().matrix().transpose();
    tangents_.row(1) = image.tangent_rad.array().sin().matrix().transpose();
    const double cosine = std::cos(AlignmentScoreGate().angle_rad);
    min_cos2_ = cosine * cosine;
  }

  // The square of the distance to the nearest point that runs along a direction, zero for any [px^2]; kMost_px at most.
  double nearestAlong2_px2(const Eigen::Vector2d& pixel, const Eigen::Vector2d& direction) const {
    double nearest2_px2 = kMost_px * kMost_px;
    const double min_together2 = min_cos2_ * direction.squaredNorm();
    grid_.eachWithin(pixel, kMost_px, [&](int j, double x, double y) {
      const double together = tangents_.col(j).dot(direction);
      if (together * together >= min_together2) nearest2_px2 = std::min(nearest2_px2, x * x + y * y);
    });
    return nearest2_px2;
  }

 private:
  BucketGrid grid_;
  Eigen::Matrix2Xd tangents_;
  double min_cos2_;
};

}  // namespace

LocalMisfit::LocalMisfit(const XrayViews& views, const OrientedModel& model, const Eigen::Matrix3Xd& displaced,
                         const Pose& T_camera_centered, bool unseen_counts)
    : points_(model.points), covariance_m2_(static_cast<std::size_t>(model.size()), Eigen::Matrix3d::Zero()) {
  const Eigen::Matrix3Xd along = directionsOf(model, displaced);
  for (const XrayView& view : views) {
    if (view.centerline.size() == 0) continue;
    const DirectedImage image(view.centerline);
    const Pose T = view.T_view_first * T_camera_centered;
    for (int i = 0; i < model.size(); ++i) {
      const Eigen::Vector3d there = T * displaced.col(i);
      const auto pixel = view.camera.project(there);
      if (!pixel || !view.sees(*pixel)) continue;
      const Eigen::Vector3d t = T.linear() * along.col(i);
      Eigen::Vector2d direction = t.head<2>() - there.head<2>() * (t.z() / there.z());
      if (direction.squaredNorm() < kEndOn2 * t.squaredNorm()) direction.setZero();
      const double nearest2_px2 = image.nearestAlong2_px2(*pixel, direction);
      if (nearest2_px2 >= kMost_px * kMost_px && !unseen_counts) continue;
      const double off2_px2 = nearest2_px2 - kSeen_px * kSeen_px;
      if (off2_px2 <= 0) continue;
      const double pixel_m = there.z() / view.camera.parameters().fx_px;
      const Eigen::Vector3d beam = T.linear().transpose() * there.normalized();
      covariance_m2_[static_cast<std::size_t>(i)] +=
          off2_px2 * pixel_m * pixel_m * (Eigen::Matrix3d::Identity() - beam * beam.transpose());
    }
  }
}

Eigen::Matrix3d LocalMisfit::covarianceAt(const Eigen::Vector3d& at) const {
  Eigen::Matrix3d sum_m2 = Eigen::Matrix3d::Zero();
  double weights = 0;
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    const double distance2_m2 = (points_.col(i) - at).squaredNorm();
    if (distance2_m2 > kReach_m * kReach_m) continue;
    const double weight = std::exp(-distance2_m2 / (2 * kAlong_m * kAlong_m));
    sum_m2 += weight * covariance_m2_[static_cast<std::size_t>(i)];
    weights += weight;
  }
  if (weights > 0) sum_m2 /= weights;
  return sum_m2;
}

}  // namespace angio::registration

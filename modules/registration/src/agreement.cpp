// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/agreement.hpp"

#include <cmath>

#include "point_matcher.hpp"

namespace angio {
namespace {

double angleBetween(double a_rad, double b_rad) { return std::abs(undirected(a_rad - b_rad)); }

// The model's points on the detector, with the direction of their vessel and the ends of their edges.
struct Silhouette {
  Eigen::Matrix2Xd pixel;       // 2 x M.
  std::vector<int> point;       // M: index in the tree.
  std::vector<int> silhouette;  // N: index here, or -1.
};

Silhouette silhouetteOf(const Eigen::Matrix3Xd& points, const XrayCamera& camera, const Pose& T_camera_model) {
  Silhouette s;
  s.pixel.resize(2, points.cols());
  s.silhouette.assign(static_cast<std::size_t>(points.cols()), -1);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto pixel = camera.project(T_camera_model * points.col(i));
    if (!pixel || !camera.sees(*pixel)) continue;
    const int k = static_cast<int>(s.point.size());
    s.pixel.col(k) = *pixel;
    s.silhouette[static_cast<std::size_t>(i)] = k;
    s.point.push_back(static_cast<int>(i));
  }
  s.pixel.conservativeResize(2, static_cast<Eigen::Index>(s.point.size()));
  return s;
}

double distanceToSegment(const Eigen::Vector2d& q, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d d = b - a;
  const double length2 = d.squaredNorm();
  const double s = length2 > 0 ? std::clamp((q - a).dot(d) / length2, 0.0, 1.0) : 0.0;
  return (q - a - s * d).norm();
}

}  // namespace

Agreement agreementOf(const VesselTree& tree, const Eigen::Matrix3Xd& points_model, const Centerline2d& centerline,
                      const XrayCamera& camera, const Pose& T_camera_model, const AgreementGate& gate) {
  Agreement result;
  const Silhouette seen = silhouetteOf(points_model, camera, T_camera_model);
  result.model_points = static_cast<int>(seen.point.size());
  if (result.model_points == 0 || centerline.size() == 0) return result;

  const PointMatcher image(centerline.points_px), model(seen.pixel);
  const auto edgesOf = [&](int k, const auto& visit) {  // Edges on the detector that meet silhouette point k.
    const int i = seen.point[static_cast<std::size_t>(k)];
    const int parent = tree.parents()[i];
    if (parent >= 0 && seen.silhouette[parent] >= 0) visit(seen.silhouette[parent]);
    for (const int child : tree.children()[i]) {
      if (seen.silhouette[child] >= 0) visit(seen.silhouette[child]);
    }
  };
  const auto runsAlong = [&](int k, double tangent_rad) {  // Whether an edge at k runs along an image tangent.
    bool along = false;
    edgesOf(k, [&](int other) {
      const Eigen::Vector2d d = seen.pixel.col(other) - seen.pixel.col(k);
      // An edge seen end-on has no direction to disagree with.
      along = along || d.norm() < 1 || angleBetween(std::atan2(d.y(), d.x()), tangent_rad) < gate.angle_rad;
    });
    return along;
  };

  int match = -1;
  double squares = 0;
  for (int k = 0; k < result.model_points; ++k) {
    const auto found = image.nearest(seen.pixel.col(k), match);
    match = found.index;
    const double distance = std::sqrt(found.distance2_px2);
    result.model_residual_px += distance / result.model_points;
    squares += found.distance2_px2 / result.model_points;
    if (distance < gate.distance_px && runsAlong(k, centerline.tangent_rad[match])) {
      result.model_explained += 1.0 / result.model_points;
    }
  }
  result.model_rms_px = std::sqrt(squares);

  match = -1;
  for (int j = 0; j < centerline.size(); ++j) {
    const Eigen::Vector2d q = centerline.points_px.col(j);
    const auto found = model.nearest(q, match);
    match = found.index;
    double distance = std::sqrt(found.distance2_px2);
    edgesOf(match, [&](int other) {
      distance = std::min(distance, distanceToSegment(q, seen.pixel.col(match), seen.pixel.col(other)));
    });
    result.image_residual_px += distance / centerline.size();
    if (distance < gate.distance_px && runsAlong(match, centerline.tangent_rad[j])) {
      result.image_explained += 1.0 / centerline.size();
    }
  }
  return result;
}

}  // namespace angio

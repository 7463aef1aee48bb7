// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/results/pose_error.hpp"

namespace angio::results {
namespace {

Eigen::Matrix3Xd placed(const VesselTree& tree, const PlacedTree& where) {
  if (where.displacements_m.cols() != tree.size()) return where.T_camera_model * tree.points();
  return where.T_camera_model * Eigen::Matrix3Xd(tree.points() + where.displacements_m);
}

}  // namespace

PoseError poseError(const VesselTree& tree, const XrayCamera& camera, const PlacedTree& estimate,
                    const PlacedTree& truth) {
  const Eigen::Matrix3Xd a = placed(tree, estimate), b = placed(tree, truth);
  PoseError error;
  const double n = tree.size();
  double sum_px = 0;
  bool all_seen = true;
  for (int i = 0; i < tree.size(); ++i) {
    const Eigen::Vector3d d = a.col(i) - b.col(i);
    error.mtre_m += d.norm() / n;
    error.depth_m += std::abs(d.z()) / n;
    error.in_plane_m += d.head<2>().norm() / n;
    error.across_beam_m += b.col(i).normalized().cross(d).norm() / n;
    const auto pixel = camera.project(a.col(i)), true_pixel = camera.project(b.col(i));
    all_seen = all_seen && pixel && true_pixel;
    if (all_seen) sum_px += (*pixel - *true_pixel).norm();
  }
  if (all_seen) {
    const double depth_m = (truth.T_camera_model * tree.centroid()).z();
    error.mpd_px = sum_px / n;
    error.mpd_isocenter_m = sum_px / n * depth_m / camera.parameters().fx_px;
  }
  error.rotation_rad = rotationAngle(estimate.T_camera_model.linear() * truth.T_camera_model.linear().transpose());
  error.centroid_m = (estimate.T_camera_model * tree.centroid() - truth.T_camera_model * tree.centroid()).norm();
  error.source_m =
      (estimate.T_camera_model.inverse().translation() - truth.T_camera_model.inverse().translation()).norm();
  return error;
}

}  // namespace angio::results

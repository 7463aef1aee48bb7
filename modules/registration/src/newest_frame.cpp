// SPDX-License-Identifier: GPL-2.0-or-later
#include "newest_frame.hpp"

#include "across_beam.hpp"
#include "deformation_nodes.hpp"
#include "deformation_posterior.hpp"
#include "line_gate.hpp"
#include "oriented_frame.hpp"

namespace angio::registration {
namespace {

constexpr double kRefinedGate_px = 12;

}  // namespace

NewestFrame::NewestFrame(const VesselTree& tree, const XrayView& view, const Pose& T_camera_centered,
                         const Eigen::Vector3d& centroid)
    : views_{view},
      model_(tree, settings_),
      from_centroid_(model_.centroid - centroid),
      T_camera_model_(T_camera_centered * Eigen::Translation3d(from_centroid_)) {}

Eigen::Matrix3Xd NewestFrame::displaced(const DeformationPosterior& posterior) const {
  return model_.points + posterior.displacements(model_.points.colwise() + from_centroid_);
}

Eigen::Matrix3Xd NewestFrame::refined(const Eigen::Matrix3Xd& displaced, double length_m) const {
  OrientedFrame frame;
  frame.begin(views_, settings_);
  const DeformationNodes nodes(model_, 1e-3 * DeformationSettings::node_mm);
  return refinedAcrossBeam(model_, nodes, length_m, frame, T_camera_model_, displaced, lineGate(kRefinedGate_px));
}

Eigen::Matrix3Xd NewestFrame::ofTree(const Eigen::Matrix3Xd& displaced) const {
  return model_.resampled.ofOriginal(displaced - model_.points);
}

std::shared_ptr<const LocalMisfit> NewestFrame::misfit(const Eigen::Matrix3Xd& displaced) const {
  // As in a single view, what the frame does not show counts as nothing.
  return std::make_shared<LocalMisfit>(views_, model_, displaced, T_camera_model_, false);
}

}  // namespace angio::registration

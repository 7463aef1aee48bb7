// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <memory>

#include "angio/geometry/se3.hpp"
#include "angio/registration/xray_view.hpp"
#include "angio/vessel/vessel_tree.hpp"
#include "local_misfit.hpp"
#include "oriented_model.hpp"

namespace angio::registration {

class DeformationPosterior;

/// A tree that several frames have placed, beside what the newest of them shows.
class NewestFrame {
 public:
  /// @param view               Borrowed.
  /// @param T_camera_centered  Of the tree about `centroid`.
  /// @param centroid           That the places of the posterior are about, model axes [m].
  NewestFrame(const VesselTree& tree, const XrayView& view, const Pose& T_camera_centered,
              const Eigen::Vector3d& centroid);

  /// Returns the model's points as the posterior displaces them, about the model's centroid, 3 x M [m].
  Eigen::Matrix3Xd displaced(const DeformationPosterior& posterior) const;

  /// Returns them where the tree is found again across the beam, from within 12 px: the other frames' groups are of
  /// other moments.
  ///
  /// @param length_m  Over which a deformation goes together.
  Eigen::Matrix3Xd refined(const Eigen::Matrix3Xd& displaced, double length_m) const;

  /// Returns the displacements of the tree's points, 3 x N [m].
  Eigen::Matrix3Xd ofTree(const Eigen::Matrix3Xd& displaced) const;

  /// Returns how far displaced points are from what the frame shows of them. Its places are about the model's centroid:
  /// less than a millimetre from `centroid`, where the tree was sampled otherwise.
  std::shared_ptr<const LocalMisfit> misfit(const Eigen::Matrix3Xd& displaced) const;

 private:
  XrayViews views_;
  OrientedKernelSettings settings_;
  OrientedModel model_;
  Eigen::Vector3d from_centroid_;
  Pose T_camera_model_;  // Of the model about its centroid.
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/registration/xray_view.hpp"
#include "oriented_model.hpp"

namespace angio::registration {

/// How far a fitted tree is from what the images show of it, place by place.
///
/// A posterior is of the matches that were made. Where a vessel was matched with its neighbour, or with nothing, the
/// tree is off by more than the posterior says, and no image point stands where the vessel is said to be. The distance
/// to the nearest image point that runs along the vessel counts as a standard deviation across the beam of that view,
/// beside the posterior's. Only places that a view sees count, inside its collimator. A vessel without contrast agent,
/// or one that the extractor missed, has no image within 15 px: that may count as 15 px, or as nothing, so that what is
/// known of it is what the posterior has from the vessels around.
class LocalMisfit {
 public:
  /// @param model              The tree, about its centroid.
  /// @param displaced          The model's points as they have been fitted, 3 x N [m].
  /// @param T_camera_centered  Pose of the fit.
  /// @param unseen_counts      Whether a vessel without any image near counts.
  LocalMisfit(const XrayViews& views, const OrientedModel& model, const Eigen::Matrix3Xd& displaced,
              const Pose& T_camera_centered, bool unseen_counts);

  /// Returns what is to be added to the covariance of the error of a place of the tree before it is displaced, model
  /// axes [m^2]: a mean over some millimetres of vessel; zero far from the tree.
  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& at) const;

 private:
  Eigen::Matrix3Xd points_;                     // The model's.
  std::vector<Eigen::Matrix3d> covariance_m2_;  // Of each.
};

}  // namespace angio::registration

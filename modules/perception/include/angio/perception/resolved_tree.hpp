// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "angio/perception/patient_observation.hpp"
#include "angio/registration/depth_from_motion.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::perception {

/// Where a tree is in the patient by the frames of a turn, for the frames that come after it. One view of a deformed
/// tree does not see its depth: across the beam a point is where a frame shows it, along it where the turn had it.
///
/// A patient who breathes is elsewhere than at the end of the turn. Along the axis of the turn, which is that of the
/// breath, only the frame says where; across it each point may be off by a third of that way, and by a drift.
class ResolvedTree {
 public:
  /// @param tree              The tree that was registered.
  /// @param fit               What the frames of a turn say together.
  /// @param T_camera_patient  Where the camera was in the newest of them.
  /// @param time_us           When that was.
  ResolvedTree(const VesselTree& tree, const DepthFromMotion& fit, const Pose& T_camera_patient, std::int64_t time_us);

  /// A point in a frame: its place [m] and the covariance of that [m^2], camera axes.
  struct Place {
    Eigen::Vector3d camera;
    Eigen::Matrix3d covariance_m2;
    double mismatch = 0;  ///< How far the frame is from the turn, squared, in standard deviations: chi^2 of two.
  };

  /// @param p_model  The point as the tree was given, model frame [m].
  /// @param seen     The frame's own registration, with its covariance.
  Place at(const Eigen::Vector3d& p_model, const RegistrationResult& seen, const Pose& T_camera_patient,
           std::int64_t time_us) const;

  /// The pose of the frame, with its covariance as PatientObservation has it: turned as the frame shows about the beam,
  /// and as the turn told about the axes across it, which one view of a deformed tree does not see either.
  ///
  /// @param place  Of the point in the frame, by at(): the pose puts the point there.
  PatientObservation pose(const Eigen::Vector3d& p_model, const Place& place, const RegistrationResult& seen,
                          const Pose& T_camera_patient) const;

  /// Whether a frame at this time is too late to be read with it.
  bool outdated(std::int64_t time_us) const;

 private:
  Eigen::VectorXd weights(const Eigen::Vector3d& p_model) const;
  double age_s(std::int64_t time_us) const;

  VesselTree tree_;
  RegistrationResult fit_;
  Pose T_patient_camera_;
  Eigen::Vector3d axis_;
  std::int64_t time_us_;
  Eigen::Matrix3d R_camera_model_, rotation_rad2_;  // Of the deformed tree, then; and how uncertain, camera axes.
};

/// One frame's points by a ResolvedTree: PatientObservation::points and PatientObservation::places of it. The target,
/// which gate and task ask for several times a frame, is computed once.
class ResolvedPoints final : public PointUncertainty, public PointPlaces {
 public:
  ResolvedPoints(std::shared_ptr<const ResolvedTree> tree, RegistrationResult seen, const Pose& T_camera_patient,
                 std::int64_t time_us, const Eigen::Vector3d& target_model)
      : tree_(std::move(tree)),
        seen_(std::move(seen)),
        T_camera_patient_(T_camera_patient),
        time_us_(time_us),
        target_model_(target_model),
        target_(tree_->at(target_model_, seen_, T_camera_patient_, time_us_)) {}

  Eigen::Matrix3d covarianceAt(const Eigen::Vector3d& p_model) const override { return at(p_model).covariance_m2; }
  Eigen::Vector3d placeAt(const Eigen::Vector3d& p_model) const override { return at(p_model).camera; }

  ResolvedTree::Place at(const Eigen::Vector3d& p_model) const {
    return p_model == target_model_ ? target_ : tree_->at(p_model, seen_, T_camera_patient_, time_us_);
  }

 private:
  std::shared_ptr<const ResolvedTree> tree_;
  RegistrationResult seen_;
  Pose T_camera_patient_;
  std::int64_t time_us_;
  Eigen::Vector3d target_model_;
  ResolvedTree::Place target_;
};

}  // namespace angio::perception

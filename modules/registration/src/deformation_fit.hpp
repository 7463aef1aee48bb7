// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <memory>

#include "deformation_equations.hpp"
#include "deformation_posterior.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// Pose and smooth deformation of a tree together, from a rigid pose near by.
///
/// First from model to image on the kernel fields, coarse to fine (left out when the image shows little of the model,
/// as a catheter in a tree: most vessels then have no image to be pulled to), then from image to model, line by line.
/// Both alternate looks and exact joint steps of pose and modes; with DeformationDetail::kFull a correction of each
/// stretch of vessel comes last. One view says nothing about displacement along its beam: displacements are then
/// parallel to its detector. Several views give all three directions. What has been matched then decides: the result is
/// the mean of pose and deformation given those matches (DeformationPosterior), in all three directions. In one view a
/// tree that is deformed by millimetres is then found again across the beam, by what goes together over shorter
/// lengths: its depths stay.
class DeformationFit {
 public:
  /// Does all that depends on the tree only. Borrows the model. Throws InputError when a setting is out of its range.
  DeformationFit(const OrientedModel& model, const DeformationSettings& settings);

  struct Result {
    Pose T_camera_centered = Pose::Identity();
    Eigen::Matrix3Xd displacements_m;  ///< Of the model's points, 3 x N, model axes.
    int iterations = 0;
    double last_step_px = 0;  ///< Root mean square over the points; steps that extrapolate count as taken.
    /// Of the twist about the centroid, model axes, whatever the deformation is.
    Matrix6d pose_covariance = Matrix6d::Identity();
    /// Of pose and deformation, whose means the others are, but for one view's displacements across the beam, which
    /// are known better; null where too little was matched for one.
    std::shared_ptr<const DeformationPosterior> posterior;
    /// What it was found from, of one view, in fewer groups, about this pose and no displacement; empty without it.
    std::vector<ResidualGroup> groups;
    Pose T_groups_camera_centered = Pose::Identity();
  };
  /// What a fit is for: to be a result, or to be compared with one, without a posterior.
  enum class Aim { kResult, kCompare };

  /// `frame` and `belief` are those of the rigid search. The same input gives the same result.
  Result fit(OrientedFrame& frame, const PosePriorTerm& belief, const Pose& T_rigid_camera_centered,
             Aim aim = Aim::kResult);

 private:
  template <int D>
  class Run;

  const OrientedModel& model_;
  DeformationSettings settings_;
  DeformationNodes nodes_;
  Eigen::MatrixXd modes_;           // M x K, see smoothModes.
  ChainPrior local_, local_alone_;  // The second when a few lines are all there is: they may be followed more closely.
  ProjectedEdges projected_;
  std::vector<LineMatches> matches_;
  std::vector<OrientedPoints> chosen_;
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "field_search.hpp"
#include "line_fit.hpp"
#include "oriented_model.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// Returns the pose of a tree with near and far exchanged, about its centroid: seen from afar, a shape and its mirror
/// image in depth look alike, and a flat shape is its own mirror image in its plane. Both mirrors make a turn.
///
/// @param flat_axis  Along which the tree is thinnest, model axes.
Pose depthMirrored(const Pose& T_camera_centered, const Eigen::Vector3d& flat_axis);

/// Weighs poses of a tree against each other on one frame, by what they explain: of the image, and of the model too
/// unless the image shows little of it.
class PoseComparison {
 public:
  PoseComparison(const OrientedModel& model, FieldSearch& fields, LineFit& lines);

  /// To be called with each frame.
  void begin(OrientedFrame& frame, bool small_image) {
    frame_ = &frame;
    small_ = small_image;
  }

  /// Fits each candidate by `plan`, scores it, and puts the best first.
  void rank(const PosePriorTerm& belief, std::vector<PoseCandidate>& candidates, const LineFitPlan& plan);

  /// The score of a pose as it is, in [0, 1].
  double score(const PosePriorTerm& belief, const Pose& T_camera_centered) const;

  /// The best pose among `others`, and the depth-mirrored one where the belief allows it, that differs from all of
  /// `known`; the first of these with a score of 0 when there is none.
  PoseCandidate bestAlternative(const PosePriorTerm& belief, const std::vector<Pose>& known_T_camera_centered,
                                const std::vector<PoseCandidate>& others) const;

  /// Whether one view may be taken for the tree with near and far exchanged: only one is seen, and the belief does not
  /// rule it out.
  bool mirrorIsOpen(const PosePriorTerm& belief, const Pose& T_camera_centered) const;

 private:
  double modelShare(const PosePriorTerm& belief, PoseCandidate& candidate) const;

  const OrientedModel& model_;
  FieldSearch& fields_;
  LineFit& lines_;
  Eigen::Vector3d flat_axis_;  // Along which the tree is thinnest, model axes.
  OrientedFrame* frame_ = nullptr;
  bool small_ = false;
};

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "oriented_frame.hpp"
#include "oriented_model.hpp"
#include "pose_prior_term.hpp"

namespace angio::registration {

/// A pose under trial.
struct PoseCandidate {
  Pose T_camera_centered = Pose::Identity();
  double score = 0;  ///< In [0, 1]; comparable among candidates of one rung only.
};

/// Whether `a` comes before `b`, best first.
inline bool better(const PoseCandidate& a, const PoseCandidate& b) { return a.score > b.score; }

/// What is supposed of a frame when poses are scored on its fields.
///
/// How much of the model the image shows is not known, and decides what a point without a match means. `outlier_mass`
/// is the kernel sum at which a point is as likely stray as matched, where a single vessel has 1. Little mass makes
/// every point look for a match, as is right where all vessels are filled with contrast agent; much mass makes a point
/// count in proportion to what it has found, so that empty branches pull at nothing.
///
/// The image's lines have to come from somewhere: a pose that has less of the model in view than `image_share` of their
/// length scores in proportion. Else the best pose of a tree that is not wholly in view is one that has only a few
/// vessels in view, where the image is dense. Too high a share, and more of the model is drawn into view than belongs
/// there: strays lengthen what the image has, what the extractor missed shortens it. 0 asks nothing of the image.
///
/// `by_shares` compares the candidates of one view at the finer scales by what image and model explain of each other
/// (ExplainedShares) in place of the fields.
struct FieldHypothesis {
  double outlier_mass;
  double image_share = 0;
  bool by_shares = false;
};

/// Ascends the kernel fields from model to image, one candidate or many.
class FieldSearch {
 public:
  explicit FieldSearch(const OrientedModel& model) : model_(model) {}

  /// Takes up to `max_steps` steps at a scale (index into kFieldScales_px) on a part of the model, or until a step
  /// moves the projection by less than a twentieth of the scale; then scores. Returns the steps taken.
  int ascend(OrientedFrame& frame, const PosePriorTerm& belief, const ModelPoints& points, int scale, int max_steps,
             const FieldHypothesis& hypothesis, PoseCandidate& candidate) const;

  /// Successive halving: all candidates a few steps at the coarsest scale on few points, the best of them at the next
  /// scale on more points, and so on. What is left is sorted, best first. Returns the steps taken.
  int halve(OrientedFrame& frame, const PosePriorTerm& belief, const FieldHypothesis& hypothesis,
            std::vector<PoseCandidate>& candidates, std::size_t keep) const;

  /// Every shift in the image plane on a grid, for each of `poses`' rotations and depths, by one look at the coarsest
  /// field for each; the best come back, at most `keep`.
  std::vector<PoseCandidate> everyShift(OrientedFrame& frame, const std::vector<Pose>& poses, double reach_m,
                                        const FieldHypothesis& hypothesis, std::size_t keep,
                                        const SearchProgress& progress) const;

 private:
  // The share of the model's projected length that has to be in view for a pose's score to count in full.
  double enoughInView(OrientedFrame& frame, const FieldHypothesis& hypothesis, const Pose& T_camera_centered) const;

  const OrientedModel& model_;
};

/// The model as oriented points of one view, about `spacing_px` apart, each with the length it stands for. `to` is
/// overwritten.
void projectedPoints(const OrientedModel& model, const XrayView& view, const Pose& T_camera_centered, double spacing_px,
                     OrientedPoints& to);

/// For a small image in a large model, as a catheter's in a tree: for each hypothesis of rotation and depth, every
/// shift in the first view's image plane within reach, by a field of the projected model that is read at the shifted
/// image points.
///
/// Returns at most `keep` poses, best first, that are some millimetres or degrees apart.
std::vector<PoseCandidate> searchShifts(const OrientedModel& model, const OrientedFrame& frame,
                                        const std::vector<Pose>& hypotheses, double reach_m, std::size_t keep);

}  // namespace angio::registration

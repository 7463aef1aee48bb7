// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "angio/localisation/catheter_localiser.hpp"

namespace angio::localisation {

/// One frame of a recorded sequence.
struct SequenceFrame {
  SeenCatheter seen;
  SeenPose pose;          ///< As far as it is known; its covariance adds to what the whole sequence shares.
  CatheterMotion motion;  ///< Since the frame before.
};

/// Settings of localiseSequence.
struct SequenceSettings {
  LocaliserSettings localiser;

  double pose_translation_std_mm = 40;
  double pose_rotation_std_deg = 3;

  // A catheter bends what it lies in.
  double deformation_std_mm = 2;
  double deformation_length_mm = 40;  ///< Length along the vessel over which the deformation is about the same.

  static constexpr int rounds = 20;  ///< Of finding the path and then the pose, at most.

  void visit(SettingsVisitor& v) {
    v.section("localiser", [&](SettingsVisitor& inner) { localiser.visit(inner); });
    v.number("pose_translation_std_mm", pose_translation_std_mm, 0.01, 1000,
             "Standard deviation of the frames' poses, all wrong in the same way, per axis");
    v.number("pose_rotation_std_deg", pose_rotation_std_deg, 0.001, 90,
             "Standard deviation of the frames' rotations, all wrong in the same way, per axis");
    v.number(
        "deformation_std_mm", deformation_std_mm, 0, 100,
        "How far the vessels are from where the tree has them, the same in all frames, per axis; 0: the tree is rigid");
    v.fixed("deformation_length_mm", deformation_length_mm, 1, 10000);
  }
};

/// What a whole sequence says.
struct SequenceResult {
  /// What all poses lacked, about the tree's centroid in model axes: T_camera_model of a frame is its given one times
  /// this.
  Pose correction = Pose::Identity();

  /// Of the tree's points, the same in all frames, model axes: 3 x N [m]; 0 where no catheter comes near.
  Eigen::Matrix3Xd displacements_m;

  std::vector<TipBelief> beliefs;  ///< One a frame, by all frames (forward and backward).
  std::vector<TipPlace> path;      ///< One a frame: the most probable route of the tip as a whole (Viterbi).
  double residual_px = 0;          ///< Mean of the frames'.
  double log_evidence = 0;  ///< Of all frames, up to a constant of their curves: compares results of one sequence.
  bool converged = false;   ///< The route and the residual have settled.
};

/// Localises a catheter in all frames at once: finds what the poses lack in common, each frame's own shift, and the
/// tip's route through the tree. Coarse to fine: the tree's path is looked for under a large shift first. In rounds,
/// for callers that have other things to do in between.
class SequenceLocaliser {
 public:
  /// Throws InputError when a setting is out of its range or there is no frame.
  SequenceLocaliser(std::vector<SequenceFrame> frames, const VesselTree& tree, const SequenceSettings& settings = {});
  ~SequenceLocaliser();
  SequenceLocaliser(SequenceLocaliser&&) noexcept;
  SequenceLocaliser& operator=(SequenceLocaliser&&) noexcept;

  /// One round of finding the path and then the pose. Returns whether it was the last.
  bool step();

  /// The answer, after the last round.
  const SequenceResult& result() const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

/// All rounds in one. `progress` is called after each. Throws InputError as SequenceLocaliser.
SequenceResult localiseSequence(const std::vector<SequenceFrame>& frames, const VesselTree& tree,
                                const SequenceSettings& settings = {},
                                const std::function<void(int rounds_done)>& progress = {});

}  // namespace angio::localisation

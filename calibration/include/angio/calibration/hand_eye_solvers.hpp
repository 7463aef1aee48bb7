// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/calibration/pose_set.hpp"

namespace angio::calibration {

/// The hand-eye problem in one form for both setups: hands[i] X cameras[i] = Z for all i.
///
/// Eye in hand: hands are T_base_hand, X = T_hand_camera, Z = T_base_object. Eye to hand: hands are T_hand_base,
/// X = T_base_camera, Z = T_hand_object. cameras are T_camera_object.
struct HandEyeEquations {
  std::vector<Pose> hands;
  std::vector<Pose> cameras;

  std::size_t size() const { return hands.size(); }
  void add(const Pose& hand, const Pose& camera);

  /// The camera's pose that X and Z predict: X^-1 hands[i]^-1 Z.
  static Pose predicted(const Pose& hand, const Pose& X, const Pose& Z) { return X.inverse() * hand.inverse() * Z; }
};

HandEyeEquations handEyeEquations(const PoseSet& set);

/// The two unknowns of HandEyeEquations.
struct HandEyeTransforms {
  Pose X = Pose::Identity();
  Pose Z = Pose::Identity();
};

/// AX = XB over the motions between all poses. Source: Park and Martin, "Robot sensor calibration: solving AX = XB on
/// the Euclidean group", IEEE T-RA 10(5), 1994; here for motions about two axes as well, by SVD. Z is the mean.
/// Wants motions that requireMotions accepts.
HandEyeTransforms solveParkMartin(const HandEyeEquations& equations);

/// AX = ZB, both at once. Source: Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker
/// product", J. Mechanisms Robotics 5(3), 2013. Wants motions that requireMotions accepts.
HandEyeTransforms solveShah(const HandEyeEquations& equations);

/// How well X and Z explain the poses: root mean square over the poses of what is between hands[i] X cameras[i] and Z,
/// which is as far as between T_camera_object and its prediction.
struct HandEyeResiduals {
  double rotation_rad = 0;
  double translation_m = 0;
};
HandEyeResiduals handEyeResiduals(const HandEyeEquations& equations, const HandEyeTransforms& transforms);

/// What another library's solver says of the same equations: for comparison, never a result.
struct ComparedSolver {
  std::string name;                             ///< "OpenCV Park", "ViSP".
  std::optional<HandEyeTransforms> transforms;  ///< Nothing when it failed.
  std::string failure;                          ///< Why, in words.
};

/// OpenCV's solvers, and ViSP's when it was there at build time and there are at most 40 poses (it is cubic in their
/// number).
std::vector<ComparedSolver> compareSolvers(const HandEyeEquations& equations);

/// How the hand turned between the poses, over all pairs: what a hand-eye calibration lives on.
struct MotionSpread {
  double max_turn_rad = 0;
  /// Axis about which there is most rotation, in the axes X maps to: the hand's (eye in hand) or the base's.
  Eigen::Vector3d main_axis = Eigen::Vector3d::UnitZ();
  double along_rad = 0;   ///< Root mean square of turns about it (as chords 2 sin(angle / 2)).
  double across_rad = 0;  ///< The same about the best axis across it: zero when all motions are about one axis.
};
MotionSpread motionSpread(const HandEyeEquations& equations);

/// Of the two ends of an axis, the one whose largest component is positive.
Eigen::Vector3d withPositiveLargest(const Eigen::Vector3d& axis);

/// Throws InputError at `place` for motions from which X and Z cannot be known, and names what stays open: fewer than
/// three poses; nothing but translations; all motions about one axis, which is named with its direction. A motion
/// counts from `min_turn_rad` on.
void requireMotions(const std::string& place, HandEyeSetup setup, const MotionSpread& spread, std::size_t poses,
                    double min_turn_rad);

/// Throws InputError at `place` when the poses only fit if they are taken differently: camera and hands in different
/// units of length (the factor is named), a pose given as its inverse, a rotation transposed, the other setup, or the
/// camera's image mirrored.
void requireConventions(const std::string& place, HandEyeSetup setup, const HandEyeEquations& equations);

/// The factor on the camera's translations with which they fit the hands' motions best: 1 when both have the same unit
/// and the object's size is right. Nothing when the motions do not tell (turns about one fixed point, as a C-arm's
/// about its isocentre).
struct TranslationScale {
  double value = 1;
  double sigma = 0;
};
std::optional<TranslationScale> translationScale(const HandEyeEquations& equations);

}  // namespace angio::calibration

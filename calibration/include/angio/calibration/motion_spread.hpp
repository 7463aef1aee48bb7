// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/calibration/hand_eye_solvers.hpp"

namespace angio::calibration {

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

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "angio/localisation/namespace.hpp"

namespace angio::localisation {

/// One place of a catheter's tip on the tree.
struct TipPlace {
  int branch = 0;          ///< Index into VesselTree::branches().
  double arc_m = 0;        ///< From the branch's start, along the vessel [m].
  double path_m = 0;       ///< From the root, along the vessel [m].
  double std_m = 0;        ///< Standard deviation of the tip's place along the vessel, given this branch [m].
  double probability = 0;  ///< That the tip is in this branch.
  Eigen::Vector3d tip_model = Eigen::Vector3d::Zero();         ///< Of the place, model frame [m].
  Eigen::Vector3d direction_model = Eigen::Vector3d::UnitX();  ///< Along the vessel, away from the root.
};

/// What a belief is based on.
enum class BeliefStatus {
  kUnknown,    ///< Nothing has been seen since the reset: `tip` is only the most probable start.
  kSeen,       ///< This frame's curve, and all before it.
  kUnsure,     ///< The same, but places too far from each other explain it; `why` says how far.
  kPredicted,  ///< Frames before this one; `why` says what was wrong with this one.
  kLost,       ///< No place on the tree explains the curve well enough; `why` says how badly.
};

/// Where a catheter's tip is, as a probability over the tree.
struct TipBelief {
  BeliefStatus status = BeliefStatus::kUnknown;
  std::string why;                     ///< What was wrong with the frame, or empty.
  TipPlace tip;                        ///< The most probable branch, and the place in it.
  double near_probability = 0;         ///< That the tip is within LocaliserSettings::near_mm of where it is said to be:
                                       ///< its place, on any branch, and its end beside that.
  std::vector<TipPlace> alternatives;  ///< Other branches of more than 1 %, most probable first.
  std::optional<double> residual_px;  ///< Mean distance of the curve from the projected path to `tip`; kSeen and kLost.
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< What the image was found shifted by against the pose [px].
};

/// Whether this frame's curve is in a belief.
inline bool isFromFrame(const TipBelief& belief) {
  return belief.status == BeliefStatus::kSeen || belief.status == BeliefStatus::kUnsure;
}

/// The name of a status, as tables show it.
inline const char* statusName(BeliefStatus status) {
  constexpr const char* kNames[] = {"unknown", "seen", "unsure", "predicted", "lost"};
  return kNames[static_cast<int>(status)];
}

/// How well one place of a tree explains what a frame shows of a catheter's tip.
struct PlaceEvidence {
  int branch = 0;           ///< Index into VesselTree::branches().
  double arc_m = 0;         ///< From the branch's start, along the vessel [m].
  double log_evidence = 0;  ///< Logarithm of the frame's probability given the tip there, up to a constant of it.
  Eigen::Vector3d tip_model = Eigen::Vector3d::Zero();  ///< The tip's end then, beside the axis, model frame [m].
  double end_std_m = 0;  ///< Of tip_model, in the direction of the largest variance: its offset along the beam.
};

/// What one frame says of where a tip is, place by place.
struct TipEvidence {
  std::vector<PlaceEvidence> places;  ///< Any order; linear between neighbours of one branch.
  double elsewhere = -30;             ///< Log evidence of all other places.
  double residual_px = 0;             ///< Of the seen tip from the place that explains it best [px].
};

/// The tip's end of the place of the evidence that is nearest to `place`, model frame [m]; nothing when none is within
/// 2 mm of it in its branch.
std::optional<Eigen::Vector3d> tipEnd(const TipEvidence& evidence, const TipPlace& place);

/// The standard deviation of that end [m]; 0 where there is none.
double tipEndStd_m(const TipEvidence& evidence, const TipPlace& place);

}  // namespace angio::localisation

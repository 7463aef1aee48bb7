// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "angio/localisation/tip_belief.hpp"

namespace angio::localisation {

/// How well one place of a tree explains what a frame shows of a catheter's tip.
struct PlaceEvidence {
  int chain = 0;     ///< Index into VesselTree::branches().
  double arc_m = 0;  ///< From the chain's start, along the vessel [m].
  double log_evidence =
      0;  ///< Logarithm of the frame's probability given the tip there, up to a constant of the frame.
  Eigen::Vector3d tip_model = Eigen::Vector3d::Zero();  ///< The tip's end then, beside the axis, model frame [m].
  double end_std_m = 0;  ///< Of tip_model, in the direction that is known least: how far it leans along the beam.
};

/// What one frame says of where a tip is, place by place.
struct TipEvidence {
  std::vector<PlaceEvidence> places;  ///< Any order; linear between neighbours of one chain.
  double elsewhere = -30;             ///< Log evidence of all other places.
  double residual_px = 0;             ///< Of the seen tip from the place that explains it best [px].
};

/// The tip's end of the place of the evidence that is nearest to `place`, model frame [m]; nothing when none is within
/// 2 mm of it in its chain.
std::optional<Eigen::Vector3d> tipEnd(const TipEvidence& evidence, const TipPlace& place);

/// The standard deviation of that end [m]; 0 where there is none.
double tipEndStd_m(const TipEvidence& evidence, const TipPlace& place);

}  // namespace angio::localisation

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/evaluation/namespace.hpp"
#include "angio/registration/iterative_pnp_settings.hpp"
#include "angio/results/campaign.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::evaluation {

// The Iterative PnP paper leaves open whether its kernel beats Euclidean losses where both sides are three-dimensional.
// A small study of that: a tree's points against its own points, moved, with the losses of the paper's figure.

/// Aligns points with points by nearest neighbours, reweighted by the loss: each source point has its nearest target
/// point, the rigid motion is that of weighed least squares (Kabsch), until rest. The kernel's scale begins at the
/// largest distance of a match, halves every 5 iterations and ends at `last_m`, which is also Huber's limit.
///
/// @param source, target  3 x N and 3 x M [m].
/// Returns T_target_source.
Pose alignedPointSets(const Eigen::Matrix3Xd& source, const Eigen::Matrix3Xd& target, const Pose& start, Kernel loss,
                      double last_m);

/// Runs every loss on the same trials: [{"world": ..., "rotation_std_deg": ..., "translation_std_mm": ..., "losses":
/// {name:
/// {"success_percent": mean distance below 2 mm, "median_mm": of it}}}]. Worlds are a copy of the points, one with
/// noise, one with points that are no vessel, and one of a part of them (big-to-small).
Json pointSetStudy(const VesselTree& tree, int trials, int seed, const Progress& progress = {},
                   Campaign* campaign = nullptr);

/// How many alignments such a study makes.
int pointSetStudySize(int trials);

/// For people, Markdown, and as a figure of a report.
std::string pointSetTable(const Json& study);
std::string pointSetFigure(const Json& study);

}  // namespace angio::evaluation

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "field_search.hpp"

namespace angio::registration {

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

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "camera_bundle.hpp"

namespace angio {

/// Solves the bundle: robustly first, then by least squares without the beads that are off and without the views that
/// another K would explain much better. Returns the given numbers of the views left out; the bundle has no longer got
/// them. Throws InputError that names the views when more of them disagree than may be left out, or beads of a view.
std::vector<std::size_t> solveRobustly(CameraBundle& bundle, const std::vector<BeadView>& views,
                                       const CameraCalibrationSettings& settings);

}  // namespace angio

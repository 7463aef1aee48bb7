// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "camera_bundle.hpp"

namespace angio {

/// A closed-form start of the bundle, with all views in it (held-out ones too), each bead that fits no projection out
/// of use. Throws InputError by name for swapped beads, mirrored views, a plane seen at one tilt, and views that fit no
/// projection.
CameraBundle startOf(const BeadPhantom& phantom, const DetectorOfViews& detector, const std::vector<BeadView>& views,
                     const CameraCalibrationSettings& settings);

/// Throws InputError when the used views' geometry leaves focal length and depth nearly one direction, by the
/// information at the start: before anything is solved.
void requireObservable(const CameraBundle& start, const BeadPhantom& phantom, const std::vector<BeadView>& views,
                       const CameraCalibrationSettings& settings);

}  // namespace angio

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/camera_calibration.hpp"

namespace angio {

/// Throws InputError that names view, bead and rule for views that cannot be what they say: beads the phantom has not,
/// a bead twice, centres off the detector, too few beads, too few views, or one view over and over again.
void checkViews(const BeadPhantom& phantom, const DetectorOfViews& detector, const std::vector<BeadView>& views,
                const CameraCalibrationSettings& settings);

}  // namespace angio

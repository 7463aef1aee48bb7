// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/calibration/camera_calibration.hpp"
#include "angio/calibration/view_set.hpp"

namespace angio {

/// For a person: values and their standard deviations, residuals, condition, weak directions, what was left out.
std::string cameraTable(const CameraCalibration& result);

/// The camera file with its record, which names `views`, the hashes of the views' files. Throws InputError when it
/// cannot be written.
void writeCalibratedCamera(const std::string& path, const CameraCalibration& result, const ViewSet& set,
                           const std::vector<CalibrationInput>& views);

/// Pictures and a page (index.html) of them: each view's beads as seen and as projected, the residuals over the
/// detector, enlarged, and where on the detector beads were seen; overview.jpg shows one of each. Makes the folder.
/// Throws InputError when it cannot be written.
void writeCameraReport(const std::string& folder, const CameraCalibration& result, const ViewSet& set);

}  // namespace angio

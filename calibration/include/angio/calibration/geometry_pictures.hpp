// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/calibration/geometry_calibration.hpp"

namespace angio::calibration {

/// Views over primary and secondary angle, as large as their residuals: blue ones, orange held out ones, red ones that
/// were left out, which are named. CV_8UC3.
cv::Mat residualsByAngle(const GeometryCalibration& result);

/// Both axes, and the beam at zero, within some millimetres of the isocentre: from the front and from the patient's
/// left, true to scale; CV_8UC3.
cv::Mat axesSketch(const GeometryCalibration& result);

/// How the arm bends over each angle while the other is zero, camera axes; CV_8UC3.
cv::Mat flexCurves(const GeometryCalibration& result);

}  // namespace angio::calibration

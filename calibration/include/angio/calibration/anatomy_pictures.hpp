// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/calibration/anatomy_registration.hpp"

namespace angio::calibration {

/// A view with its vessels as seen, the tree as registered in this view alone, and as the one T_dsa_cb of all views has
/// it; the caption names an outlier. `image` may be empty. CV_8UC3 of the camera's size.
cv::Mat anatomyOverlay(const AnatomyResult& result, const AnatomyView& view, const SeenAnatomy& seen,
                       const VesselTree& tree, const cv::Mat& image);

/// How far each view's own registration is from the joint one, in degrees and in millimetres below; outliers are red.
cv::Mat anatomyResiduals(const AnatomyResult& result);

}  // namespace angio::calibration

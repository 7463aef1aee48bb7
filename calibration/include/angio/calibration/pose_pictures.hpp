// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>

#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/hand_eye.hpp"

namespace angio::calibration {

/// Each pose's distance from its prediction, in degrees and in millimetres below; outliers are red. CV_8UC3.
cv::Mat poseResiduals(const HandEyeResult& result);

/// About which axes the hand turned between any two poses: half of a sphere from above, of equal areas, in the axes of
/// motionSpread, where the two ends of an axis are one point; the wider the turn, the larger the dot. CV_8UC3.
cv::Mat turnAxes(const PoseSet& set);

/// Standard deviations along the axes of the covariance's ellipsoids, one for the place and one for the turn of each
/// transform, with their directions in the parent frame. CV_8UC3.
cv::Mat covarianceBars(const PoseSet& set, const HandEyeResult& result);

/// A view with its vessels as seen, the tree as registered in this view alone, and as the one T_dsa_cb of all views has
/// it; the caption names an outlier. `image` may be empty. CV_8UC3 of the camera's size.
cv::Mat anatomyOverlay(const AnatomyResult& result, const AnatomyView& view, const SeenAnatomy& seen,
                       const VesselTree& tree, const cv::Mat& image);

/// How far each view's own registration is from the joint one, in degrees and in millimetres below; outliers are red.
cv::Mat anatomyResiduals(const AnatomyResult& result);

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "bead_profile.hpp"

namespace angio::calibration {

/// Between the radii that are looked for.
constexpr double kBlobScaleStep = 1.25;

/// What may be a ball, and how much of a blob it is.
struct BeadCandidate {
  BallShadow ball;
  double response = 0;
};

/// Pixels that the collimator leaves open, without its soft edge: not zero there (CV_8UC1).
cv::Mat openPixels(const cv::Mat& image);

/// Absorption above its surroundings (CV_32FC1) of grey values (CV_32FC1): what is wider than a ball is ground.
cv::Mat withoutGround(const cv::Mat& values, double max_radius_px);

/// Blobs over all scales, strongest first, each where it answers more than its neighbours in place and scale do, and
/// `min_response` at least, where `mask` (CV_8UC1) is not zero.
std::vector<BeadCandidate> blobs(const cv::Mat& above_ground, const cv::Mat& mask,
                                 const BeadDetectionSettings& settings, double min_response);

}  // namespace angio::calibration

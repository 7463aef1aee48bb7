// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/calibration/bead_detection.hpp"
#include "angio/calibration/bead_phantom.hpp"
#include "angio/calibration/view_set.hpp"

namespace angio::calibration {

/// The pattern's corners or circles' centres, row by row, in the plane z = 0 [m].
BeadPhantom phantomOf(const FlatPattern& pattern);

/// Finds the pattern in a photograph (one channel of 8 or 16 bits), each mark with its number in phantomOf(), by
/// OpenCV. Throws InputError that names the file when the whole pattern is not to be seen.
std::vector<BeadDetection> detectPattern(const std::string& path, const cv::Mat& image, const FlatPattern& pattern);

}  // namespace angio::calibration

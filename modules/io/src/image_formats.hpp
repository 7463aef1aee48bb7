// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace angio {

/// The largest image that is read, in each direction [px].
constexpr unsigned kLargestSide = 8192;

/// Decode a PNG or a TIFF file: CV_8UC1, CV_16UC1, CV_8UC3 or CV_16UC3. OpenCV's own readers and the libraries' default
/// error handlers write to the terminal, so both are called with handlers of ours. Throw InputError that names `path`.
cv::Mat decodePng(const std::string& path, const std::string& content);
cv::Mat decodeTiff(const std::string& path, const std::string& content);

}  // namespace angio

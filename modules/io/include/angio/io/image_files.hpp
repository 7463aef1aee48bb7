// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "angio/geometry/xray_camera.hpp"

namespace angio {

/// Reads an X-ray image, PNG or TIFF by content: CV_8UC1 or CV_16UC1. Colour images pass when all channels are equal.
/// Throws InputError that names the file for anything else, for a broken image and for more than 8192 x 8192 pixels.
cv::Mat readXrayImage(const std::string& path);

/// The same, of one camera's detector: throws InputError too when the image is not of the camera's size.
cv::Mat readXrayImage(const std::string& path, const XrayCamera& camera);

/// Writes PNG, TIFF or JPEG by extension (in any case), whole or not at all. `image` is CV_8UC1, CV_8UC3 (blue, green,
/// red) or, but not for JPEG, CV_16UC1. Throws InputError for other types and when the file cannot be written.
void writeImage(const std::string& path, const cv::Mat& image);

}  // namespace angio

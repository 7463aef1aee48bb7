// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// Decodes a grey JPEG: CV_8UC1. One of three channels passes when it has no colour beyond what the compression leaves
/// of grey, and its luminance is taken. libjpeg is called with handlers of ours: its own print, end the program, and
/// fill what is missing of a file with grey. Throws InputError that names `path` for a broken or cut file, colours and
/// more than 8192 px in a direction.
cv::Mat decodeJpeg(const std::string& path, std::string_view content);

}  // namespace angio::io

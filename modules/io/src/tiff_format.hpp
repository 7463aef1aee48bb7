// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// The longest sequence in one TIFF: libtiff takes quadratic time for its pages.
constexpr int kMaxPages = 10'000;

/// Decodes a page of a TIFF file, from 0: CV_8UC1, CV_16UC1, CV_8UC3 or CV_16UC3. OpenCV's own reader and libtiff's
/// default error handlers write to the terminal, so libtiff is called with handlers of ours. Throws InputError that
/// names `path`.
cv::Mat decodeTiff(const std::string& path, const std::string& content, int page);

/// How many pages a TIFF has. Throws InputError when one cannot be found or there are more than kMaxPages.
int countTiffPages(const std::string& path, const std::string& content);

/// A TIFF of grey pages of one size and type. Throws InputError when it cannot be encoded or exceeds `max_bytes`.
std::string encodeTiff(const std::string& path, const std::vector<cv::Mat>& pages, std::size_t max_bytes);

}  // namespace angio::io

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// The largest PNG image that is read, in each direction [px].
constexpr unsigned kMaxPngSide = 8192;

/// Size and type as a PNG's first bytes claim them.
struct PngHeader {
  std::uint32_t width_px = 0, height_px = 0;
  int bits = 0;       ///< Of a sample.
  bool grey = false;  ///< One channel without transparency, not interlaced.
};

/// Nothing when the content does not begin as a PNG does.
std::optional<PngHeader> pngHeader(std::string_view content);

/// An image from PNG's bytes, which may come from anywhere: CV_8UC1, CV_16UC1, CV_8UC3 or CV_16UC3. OpenCV's own reader
/// and libpng's default handlers write to the terminal, so libpng is called with handlers of ours. Throws InputError
/// that names `place`.
cv::Mat decodePng(const std::string& place, std::string_view content);

/// An X-ray (CV_8UC1 or CV_16UC1, not empty) as PNG, for speed rather than for size. Throws std::invalid_argument for
/// other images.
std::vector<std::uint8_t> encodePng(const cv::Mat& image);

}  // namespace angio::imaging

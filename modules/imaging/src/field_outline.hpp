// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Corners of the open field as findOpenField gives them, without drawing a mask; empty when all is open.
std::vector<cv::Point2f> outlineOfField(const cv::Mat& image);

/// The pixels [begin, end) of each row whose centres lie in a convex polygon by at least `inset` pixels.
struct RowRange {
  int begin = 0, end = 0;
};
std::vector<RowRange> rowsInside(const std::vector<cv::Point2f>& polygon, const cv::Size& size, float inset);

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "angio/plotting/subpixel.hpp"
#include "angio/results/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::results {

extern const cv::Scalar kGroundColor;  ///< Dark, behind everything.

/// A pixel position for OpenCV's drawing functions.
inline cv::Point subpixel(const Eigen::Vector2d& p) { return plotting::subpixel(cv::Point2d(p.x(), p.y())); }

/// An X-ray (CV_8UC1 or CV_16UC1, not empty) as CV_8UC3, its grey levels spread over the range.
cv::Mat greyPicture(const cv::Mat& image);

/// Points of a branch are joined; points without order stay points.
void drawCurve(cv::Mat& canvas, const Centerline2d& centerline, const cv::Scalar& color_bgr, int width_px);

/// Draws a line of text with a dark rim, whose stroke is `rim_px` wider. A text that would leave the canvas on the
/// right is drawn smaller.
void writeText(cv::Mat& canvas, const std::string& text, const cv::Point& at, const cv::Scalar& color_bgr,
               double size = 0.75, int stroke_px = 2, int rim_px = 3);

}  // namespace angio::results

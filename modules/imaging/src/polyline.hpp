// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/types.hpp>
#include <vector>

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

using Polyline = std::vector<cv::Point2f>;

/// Mean of neighbouring points, weighted by a normal distribution of `sigma` points. The ends of an open line stay
/// where they are, for it is continued by its point reflection there; a closed one has no ends.
Polyline smoothed(const Polyline& line, float sigma, bool closed);

/// Places on the line at equal steps of about `spacing`, both ends included: index and fraction in one number.
std::vector<float> equalSteps(const Polyline& line, float spacing);

/// The line at such a place.
cv::Point2f at(const Polyline& line, float place);

/// The direction of the line at point i, over `reach` points to both sides where they exist. Length one, or zero.
cv::Point2f directionAt(const Polyline& line, std::size_t i, std::size_t reach);

}  // namespace angio::imaging

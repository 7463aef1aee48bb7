// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"

namespace angio::imaging {

/// Whether a point is so near to the border of the open part (a range for each row) that a line which ends there comes
/// in from outside.
bool atBorder(const cv::Point2f& p, const std::vector<RowRange>& open);

/// The middling one of the values, at least one.
float medianOf(std::vector<float> values);

/// Contrast over radius at a line's first `count` points [1/working px]: what its content absorbs per length, up to a
/// factor.
std::vector<float> densitiesOf(const CentreLine& line, std::size_t count);

/// Drops lines that follow the border of the open part: what is left of its shadow's edge.
void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open);

/// Drops faint lines that are too wide for their contrast: ribs, vertebrae and the edges of organs.
///
/// Density is alike wherever contrast agent has come. A line goes when its own (median) is below `least` times that of
/// all points of vessels, unless no bone is so dark. One with neither end at another line must be denser: nothing else
/// says that it is a vessel. Devices, where they have been told, have no part in it: beside steel all vessels would be
/// dilute.
void dropDilute(std::vector<CentreLine>& lines, float least);

}  // namespace angio::imaging

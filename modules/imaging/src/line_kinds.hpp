// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"

namespace angio {

/// Drops lines that follow the border of the open part: what is left of its shadow's edge.
void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open);

/// Drops faint lines that are too wide for their contrast: ribs, vertebrae and the edges of organs.
///
/// Contrast over diameter is what a vessel's content absorbs per length, which is alike wherever contrast agent has
/// come. A line goes when its own (median) is below `least` times that of all lines' points, unless no bone is so dark.
void dropDilute(std::vector<CentreLine>& lines, float least);

/// Finds catheters and guidewires among the lines of one image and sets their kind; a line that is a device first and a
/// vessel then is cut in two.
///
/// A device comes in at the border of the open part (a range for each row), keeps its width and its contrast over
/// `shortest` working pixels at least, and nothing branches off it; and there are vessels beside it. A vessel that
/// looks the same, an unbranched one of even width from the border on, cannot be told from it, nor can a catheter in a
/// frame without vessels; a device that does not reach the border is taken for a vessel.
void tellDevices(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest);

}  // namespace angio

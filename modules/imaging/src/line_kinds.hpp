// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"

namespace angio::imaging {

/// Drops lines that follow the border of the open part: what is left of its shadow's edge.
void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open);

/// Finds guidewires among the lines of one image and sets their kind: as thin as the image resolves and nearly twice as
/// dense, contrast over radius, as the wider lines, which bring as much length, wherever they are. A wire's width and
/// density are steady along it.
void tellWires(std::vector<CentreLine>& lines);

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/vessel/centerline2d.hpp"
#include "centre_lines.hpp"
#include "flatten.hpp"

namespace angio::imaging {

/// Lines in working pixels -> points of the image at equal distances, with the tangents of the lines.
Centerline2d sampled(const std::vector<CentreLine>& lines, const WorkingGrid& grid, double spacing_px);

}  // namespace angio::imaging

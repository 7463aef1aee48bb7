// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "ridge_scales.hpp"

namespace angio::imaging {

/// Sets each line's `step`, measured in an image whose noise is filtered.
void compareFlanks(std::vector<CentreLine>& lines, const ScaleImage& image);

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "angio/imaging/extractor.hpp"
#include "centre_lines.hpp"

namespace angio::imaging {

std::unique_ptr<CenterlineExtractor> make(const OtsuSettings& settings);

/// Is shown an image's lines before the unlikely ones are dropped: working pixels, wires told.
using LineObserver = std::function<void(const std::vector<CentreLine>& lines, const WorkingGrid& grid)>;

std::unique_ptr<CenterlineExtractor> make(const RidgeSettings& settings, LineObserver observe = nullptr);

}  // namespace angio::imaging

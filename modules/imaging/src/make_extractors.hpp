// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/imaging/extractor.hpp"

namespace angio::imaging {

std::unique_ptr<CenterlineExtractor> make(const OtsuSettings& settings);
std::unique_ptr<CenterlineExtractor> make(const RidgeSettings& settings);

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/extractor.hpp"

#include "angio/base/settings.hpp"
#include "make_extractors.hpp"

namespace angio::imaging {

Centerline2d CenterlineExtractor::extract(const cv::Mat& image, const Centerline2d&) { return extract(image); }

std::unique_ptr<CenterlineExtractor> makeExtractor(const ExtractorSettings& settings) {
  return madeOf(settings, [](const auto& chosen) { return make(chosen); });
}

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/extractor.hpp"

#include "angio/base/settings.hpp"
#include "make_extractors.hpp"

namespace angio::imaging {

std::unique_ptr<CenterlineExtractor> makeExtractor(const ExtractorSettings& settings) {
  return std::visit(
      [](const auto& chosen) {
        checkSettings(chosen.kName, chosen);
        return make(chosen);
      },
      settings);
}

}  // namespace angio::imaging

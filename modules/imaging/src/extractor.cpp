// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/extractor.hpp"

#include <optional>

#include "angio/base/errors.hpp"
#include "angio/base/settings.hpp"
#include "otsu.hpp"
#include "ridge.hpp"

namespace angio::imaging {
namespace {

// Calls `take` with the default settings of each method.
template <std::size_t I = 0, typename Take>
void forEachMethod(const Take& take) {
  if constexpr (I < std::variant_size_v<ExtractorSettings>) {
    take(std::variant_alternative_t<I, ExtractorSettings>());
    forEachMethod<I + 1>(take);
  }
}

}  // namespace

std::vector<std::string> extractorNames() {
  std::vector<std::string> names;
  forEachMethod([&](const auto& method) { names.push_back(method.kName); });
  return names;
}

ExtractorSettings extractorSettingsNamed(const std::string& name) {
  std::optional<ExtractorSettings> found;
  std::string known;
  forEachMethod([&](const auto& method) {
    if (name == method.kName) found = method;
    known += (known.empty() ? "" : ", ") + std::string(method.kName);
  });
  if (!found) throw InputError("", "extractor", name, "must be one of " + known);
  return *found;
}

std::string extractorName(const ExtractorSettings& settings) {
  return std::visit([](const auto& chosen) -> std::string { return chosen.kName; }, settings);
}

std::unique_ptr<CenterlineExtractor> makeExtractor(const ExtractorSettings& settings) {
  return std::visit(
      [](const auto& chosen) {
        checkSettings(chosen.kName, chosen);
        return make(chosen);
      },
      settings);
}

}  // namespace angio::imaging

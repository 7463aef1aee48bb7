// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/apps/namespace.hpp"
#include "angio/imaging/extractor.hpp"

namespace angio::apps {

/// The names of extractors, for the help of options.
inline std::string listOfExtractors() {
  std::string list;
  for (const auto& name : ExtractorSections::names()) list += (list.empty() ? "" : " or ") + name;
  return list;
}

}  // namespace angio::apps

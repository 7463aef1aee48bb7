// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/io/former_keys.hpp"

#include <algorithm>

namespace angio {
namespace {

// Whether an entry of the table, "ridge.sigma" or "sigma", means a key of these sections.
bool means(const std::string& entry, const std::vector<std::string>& sections, const std::string& key) {
  std::string path;
  for (const std::string& section : sections) path += "." + section;
  path += "." + key;
  const std::string end = "." + entry;
  return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

bool FormerKeys::isConstant(const std::vector<std::string>& sections, const std::string& key) const {
  return std::any_of(constants.begin(), constants.end(),
                     [&](const std::string& entry) { return means(entry, sections, key); });
}

std::optional<std::string> FormerKeys::nameNow(const std::vector<std::string>& sections, const std::string& key,
                                               const std::vector<std::string>& known) const {
  const auto isKnown = [&](const std::string& name) {
    return std::find(known.begin(), known.end(), name) != known.end();
  };
  for (const Renamed& entry : renamed) {
    if (means(entry.former, sections, key) && isKnown(entry.key)) return entry.key;
  }
  for (const Prefix& entry : prefixes) {
    if (key.compare(0, entry.former.size(), entry.former) != 0) continue;
    const std::string name = entry.prefix + key.substr(entry.former.size());
    if (isKnown(name)) return name;
  }
  return std::nullopt;
}

const FormerKeys& formerKeys() {
  static const FormerKeys table = {
      // Constants.
      {},
      // Renamed.
      {},
      // Prefixes.
      {{"most_", "max_"},
       {"largest_", "max_"},
       {"longest_", "max_"},
       {"furthest_", "max_"},
       {"least_", "min_"},
       {"shortest_", "min_"}},
  };
  return table;
}

}  // namespace angio

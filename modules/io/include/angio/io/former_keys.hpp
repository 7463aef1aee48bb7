// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// Keys of settings files that earlier versions knew, and what has become of them. A former key stays in the table for
/// one minor version: until then a file that has it is read with a warning, afterwards it is refused as unknown.
///
/// A key is named by itself, or behind the sections it stood in: "sigma" is meant in every section, "ridge.sigma" in
/// each section `ridge`. An entry counts only where no setting has that key.
struct FormerKeys {
  struct Renamed {
    std::string former;  ///< "ridge.sigma"; a section's key can be renamed like any other.
    std::string key;     ///< What it is called now, in the same section: "sigma_px".
  };
  struct Prefix {
    std::string former;  ///< "most_": the prefix that keys had.
    std::string prefix;  ///< "max_": the one that they have. A key without a setting under its new name is unknown.
  };

  std::vector<std::string> constants;  ///< Keys of what cannot be set any more: they are ignored.
  std::vector<Renamed> renamed;
  std::vector<Prefix> prefixes;

  /// Whether a key of the given sections, the outermost first, was a setting that is a constant now.
  bool isConstant(const std::vector<std::string>& sections, const std::string& key) const;

  /// What a key may be called now: that of `renamed` or that of the prefixes, the first of the two that is in `known`.
  std::optional<std::string> nameNow(const std::vector<std::string>& sections, const std::string& key,
                                     const std::vector<std::string>& known) const;
};

/// The former keys of this version, all in one table.
const FormerKeys& formerKeys();

}  // namespace angio::io

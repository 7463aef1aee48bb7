// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <iostream>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/io/namespace.hpp"

namespace angio::io {

/// Keys of settings files that earlier versions knew, and what has become of them. A former key stays in the table for
/// one minor version: until then a file that has it is read with a warning, afterwards it is refused as unknown.
///
/// A key is named by itself, or behind the sections it stood in: "sigma" is meant in every section, "ridge.sigma" in
/// each section `ridge`. An entry counts only where no setting has that key.
struct FormerKeys {
  /// A key that has another name now.
  struct Renamed {
    std::string former;  ///< "ridge.sigma"; a section's key can be renamed like any other.
    std::string key;     ///< What it is called now, in the same section: "sigma_px".
  };
  /// A prefix that has been exchanged in all keys.
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

/// Reads settings from plain YAML into the fields that `visit_fields` names. Every key is optional: a field that is not
/// in the file keeps its value; an empty file changes nothing. Sections are nested maps.
///
/// A former key is read under the name it has now, or ignored if it is a constant now. `warnings` gets one line for
/// each, "file:line: key = value: rule".
///
/// Throws InputError "file:line: key = value: rule" for unknown and repeated keys, a setting under its former and its
/// present name, wrong types and values out of range; some fields may have been set by then.
void readSettings(const std::string& path, const std::function<void(SettingsVisitor&)>& visit_fields,
                  const FormerKeys& former = formerKeys(), std::ostream& warnings = std::cerr);

/// The effective settings, in the order of the fields: numbers, integers, booleans, names of choices, nested objects.
nlohmann::ordered_json settingsAsJson(const std::function<void(SettingsVisitor&)>& visit_fields);

/// The effective settings as YAML that readSettings reads back the same: a line for each key with a comment of its
/// meaning and of its range or choices, nested maps for sections.
std::string settingsAsYaml(const std::function<void(SettingsVisitor&)>& visit_fields);

/// A type that `visit`s its fields.
template <typename Settings>
using IfSettings = decltype(std::declval<Settings&>().visit(std::declval<SettingsVisitor&>()));

/// The same for a struct with `visit`: `defaults` overwritten by the file.
template <typename Settings, typename = IfSettings<Settings>>
Settings readSettings(const std::string& path, Settings defaults) {
  readSettings(path, fieldsOf(defaults));
  return defaults;
}

/// The same for a struct with `visit`. The result is a parameter because it is whole only where this is called.
template <typename Settings, typename Json = nlohmann::ordered_json, typename = IfSettings<Settings>>
Json settingsAsJson(Settings settings) {
  return settingsAsJson(fieldsOf(settings));
}

/// The same for a struct with `visit`.
template <typename Settings, typename = IfSettings<Settings>>
std::string settingsAsYaml(Settings settings) {
  return settingsAsYaml(fieldsOf(settings));
}

/// The settings that are in force with this file, the defaults when `path` is empty: for --print-settings.
template <typename Settings>
std::string settingsInForce(const std::string& path) {
  return settingsAsYaml(path.empty() ? Settings{} : readSettings(path, Settings{}));
}

}  // namespace angio::io

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "angio/base/settings.hpp"
#include "angio/io/former_keys.hpp"

namespace angio::io {

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

/// A type that `visit`s its fields.
template <typename Settings>
using IfSettings = decltype(std::declval<Settings&>().visit(std::declval<SettingsVisitor&>()));

/// The same for a struct with `visit`: `defaults` overwritten by the file.
template <typename Settings, typename = IfSettings<Settings>>
Settings readSettings(const std::string& path, Settings defaults) {
  readSettings(path, std::function<void(SettingsVisitor&)>([&](SettingsVisitor& v) { defaults.visit(v); }));
  return defaults;
}

/// The same for a struct with `visit`.
template <typename Settings, typename = IfSettings<Settings>>
nlohmann::ordered_json settingsAsJson(Settings settings) {
  return settingsAsJson(std::function<void(SettingsVisitor&)>([&](SettingsVisitor& v) { settings.visit(v); }));
}

}  // namespace angio::io

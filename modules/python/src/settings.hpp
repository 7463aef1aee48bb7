// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "angio/base/settings.hpp"
#include "binding.hpp"

namespace angio::python {

using Json = nlohmann::ordered_json;

/// Dicts, lists, texts, numbers, booleans and None as JSON, and back. Throws InputError that names `field` for anything
/// else.
Json jsonOf(const py::handle& object, const std::string& field);
py::object pythonOf(const Json& json);

/// Sets the fields that a dict, or the settings file of this path, names; none for None. Throws InputError as
/// io::readSettings() does; former keys become warnings of Python.
void setFields(const py::object& given, const std::string& name,
               const std::function<void(SettingsVisitor&)>& visit_fields);

/// `settings` with the fields that are given.
template <typename Settings>
Settings withFields(Settings settings, const py::object& given, const std::string& name) {
  setFields(given, name, base::fieldsOf(settings));
  return settings;
}

}  // namespace angio::python

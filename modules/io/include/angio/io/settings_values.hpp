// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/io/settings_files.hpp"

namespace angio::io {

/// Sets fields as readSettings() does, from values in memory: an object of settingsAsJson()'s form, with as many of its
/// keys as are meant. `name` stands in place of file and line. Throws InputError as readSettings() does.
void setSettings(const std::string& name, const nlohmann::ordered_json& values,
                 const std::function<void(SettingsVisitor&)>& visit_fields, const FormerKeys& former = formerKeys(),
                 std::ostream& warnings = std::cerr);

}  // namespace angio::io

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"

namespace angio::base {

/// Returns the settings that it is given. Throws as checkSettings() does.
template <typename Settings>
const Settings& checked(const std::string& place, const Settings& settings) {
  checkSettings(place, settings);
  return settings;
}

}  // namespace angio::base

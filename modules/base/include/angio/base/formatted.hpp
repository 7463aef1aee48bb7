// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdio>
#include <string>
#include <type_traits>

#include "angio/base/namespace.hpp"

namespace angio::base {

/// What printf would print, up to 511 characters. Of numbers and C strings alone: what else goes through an ellipsis is
/// not what is read at its end.
template <typename... Values>
std::string formatted(const char* format, Values... values) {
  static_assert(
      ((std::is_arithmetic_v<Values> || std::is_same_v<Values, const char*> || std::is_same_v<Values, char*>)&&...),
      "formatted() takes numbers and C strings");
  char text[512];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

}  // namespace angio::base

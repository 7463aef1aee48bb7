// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// A file of the real data that may not be copied into the project, in the folder that ANGIO_SHARED_DATA names.
inline std::string sharedData(const std::string& name) {
  const char* const folder = std::getenv("ANGIO_SHARED_DATA");
  return std::string(folder ? folder : "") + "/" + name;
}

}  // namespace angio::test

/// Skips the test, by name, on a machine that has not got the file.
#define NEED_SHARED_DATA(name)                                                                          \
  if (!std::getenv("ANGIO_SHARED_DATA") || !std::filesystem::exists(::angio::test::sharedData(name))) { \
    GTEST_SKIP() << name << " is not there: ANGIO_SHARED_DATA must name the folder it is in";           \
  }

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "angio/base/errors.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// The line a user would read when `action` refuses its input; fails the test when it does not refuse.
template <typename Action>
std::string refusalOf(const Action& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "no InputError was thrown";
  return "";
}

}  // namespace angio::test

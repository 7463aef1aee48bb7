// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <variant>

#include "angio/test/namespace.hpp"

namespace angio::test {

/// The alternatives of a settings variant as a list for TYPED_TEST_SUITE: a new method joins its conformance tests by
/// itself.
template <typename Variant>
struct TypesOf;
template <typename... Alternatives>
struct TypesOf<std::variant<Alternatives...>> {
  using type = testing::Types<Alternatives...>;
};

}  // namespace angio::test

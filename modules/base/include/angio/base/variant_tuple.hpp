// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <tuple>
#include <variant>

#include "angio/base/namespace.hpp"

namespace angio::base {

template <typename Variant>
struct VariantTuple;
/// The tuple of a variant's alternatives, as `type`.
template <typename... Settings>
struct VariantTuple<std::variant<Settings...>> {
  using type = std::tuple<Settings...>;
};

/// One of each of a variant's alternatives: the settings of all methods, of which a variant holds the chosen one's.
template <typename Variant>
using OneOfEach = typename VariantTuple<Variant>::type;

}  // namespace angio::base

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <type_traits>
#include <utility>

#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// Whether a registration lets the tree deform, after or together with its pose.
enum class Deformation { kRigid, kNonrigid };

/// Whether a method, by the type of its settings, can let the tree deform: it has a setting `deformation`.
template <typename Settings, typename = void>
struct CanDeform : std::false_type {};
template <typename Settings>
struct CanDeform<Settings, std::void_t<decltype(std::declval<Settings&>().deformation)>> : std::true_type {};

}  // namespace angio::registration

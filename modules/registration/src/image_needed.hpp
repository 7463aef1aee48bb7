// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <type_traits>

#include "angio/registration/xray_view.hpp"

namespace angio::registration {

/// Whether a method, by the type of its settings, looks at the X-ray image.
template <typename Settings, typename = void>
struct NeedsImage : std::false_type {};
template <typename Settings>
struct NeedsImage<Settings, std::void_t<decltype(Settings::kNeedsImage)>> : std::true_type {};

/// Throws InputError that names the method when a view has no image, or one that is not of its detector.
void requireImages(const XrayViews& views, const char* method);

}  // namespace angio::registration

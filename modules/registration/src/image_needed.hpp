// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <type_traits>

#include "angio/base/errors.hpp"
#include "angio/registration/xray_view.hpp"

namespace angio::registration {

/// Whether a method, by the type of its settings, looks at the X-ray image.
template <typename Settings, typename = void>
struct NeedsImage : std::false_type {};
template <typename Settings>
struct NeedsImage<Settings, std::void_t<decltype(Settings::kNeedsImage)>> : std::true_type {};

/// Throws InputError that names the method when a view has no image.
inline void requireImages(const XrayViews& views, const char* method) {
  for (const XrayView& view : views) {
    if (!view.image)
      throw InputError("", "method", method, "needs the X-ray image of each view, not its centreline alone");
  }
}

}  // namespace angio::registration

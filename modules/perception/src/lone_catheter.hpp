// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/localisation/seen_catheter.hpp"
#include "angio/perception/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::perception {

/// A catheter that is all there is to see.
struct LoneCatheter {
  SeenCatheter seen;
  Centerline2d curve;  ///< Its points as they were found, in branches.
};

/// Returns the catheter of an image that shows one curve, in one piece or several.
///
/// Lines of the background do not count: they absorb less than half per length of what the longest line does, and keep
/// away from it, as no vessel's branches do. They are known where the extractor has said contrast and radius.
std::optional<LoneCatheter> loneCatheter(const Centerline2d& found, const XrayCamera& camera);

}  // namespace angio::perception

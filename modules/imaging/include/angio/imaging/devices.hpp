// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/imaging/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::imaging {

/// Tells catheters and guidewires by a frame without contrast agent: what `in_mask`, the centrelines of that frame,
/// shows as well was there before the vessels were filled.
///
/// A branch of `found` is a device when most of its points lie on a line of `in_mask`, within the larger of two pixels
/// and the curve's radius, and point in its direction. The result is `found` with `kind` set for every point, whatever
/// it said before. Both come from frames that show the patient in one place: shift `in_mask` by maskShift first.
Centerline2d withDevicesOf(const Centerline2d& found, const Centerline2d& in_mask);

}  // namespace angio::imaging

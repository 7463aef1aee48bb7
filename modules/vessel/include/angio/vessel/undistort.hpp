// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/distortion.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::vessel {

/// The centreline as a pinhole camera would have seen it: points moved, tangents turned, radii and uncertainties scaled
/// by what the distortion does there. Points where no pinhole pixel goes are left out.
Centerline2d undistorted(const Centerline2d& seen, const DetectorDistortion& distortion);

}  // namespace angio::vessel

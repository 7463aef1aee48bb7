// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/calibration/namespace.hpp"
#include "angio/geometry/distortion.hpp"

namespace angio::calibration {

/// How a polynomial map's image moves when it turns by one radian at the rim of the map's circle, and elsewhere by the
/// square of the radius as much, to first order [px].
DisplacementPolynomial turnOf(const DetectorDistortion& map);

/// The map with such a turn.
DetectorDistortion turnedMap(const DetectorDistortion& map, double turn_rad);

}  // namespace angio::calibration

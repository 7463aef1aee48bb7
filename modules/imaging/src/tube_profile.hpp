// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

/// Radius of a tube whose X-ray profile, blurred, is 2 * `half_width` wide at half of its height. `blur` is the
/// standard deviation of the noise filter; the averaging by pixels is added here. All in working pixels.
///
/// The sharp profile of a tube, the chord of a circle, falls to half at sqrt(3)/2 of the radius. Blur widens a thin one
/// and, because the chord is steepest at its ends, narrows a thick one. Returns 0 for a width that blur alone explains.
float tubeRadius(float half_width, float blur);

}  // namespace angio::imaging

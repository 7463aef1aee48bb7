// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/registration/namespace.hpp"
#include "angio/tubes/tubes.hpp"

namespace angio::registration {

/// The tubes drawn at least so wide [m], with as much less in them: one that falls between the rays of a coarse image
/// would come and go with the pose.
inline std::vector<Tube> withMinRadius(std::vector<Tube> tubes, double min_radius_m) {
  for (Tube& tube : tubes) {
    if (tube.radius_m >= min_radius_m) continue;
    tube.density *= (tube.radius_m * tube.radius_m) / (min_radius_m * min_radius_m);
    tube.radius_m = min_radius_m;
  }
  return tubes;
}

}  // namespace angio::registration

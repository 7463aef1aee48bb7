// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "angio/registration/namespace.hpp"
#include "angio/tubes/tubes.hpp"

namespace angio::registration {

/// The tubes drawn at least so wide [m], with as much less in them: one that falls between the rays of a coarse image
/// would come and go with the pose.
inline std::vector<Tube> withMinRadius(std::vector<Tube> tubes, double min_radius_m) {
  for (Tube& tube : tubes) {
    const double before_m2 = tube.radius_a_m * tube.radius_a_m + tube.radius_b_m * tube.radius_b_m;
    tube.radius_a_m = std::max(tube.radius_a_m, min_radius_m);
    tube.radius_b_m = std::max(tube.radius_b_m, min_radius_m);
    tube.density *= before_m2 / (tube.radius_a_m * tube.radius_a_m + tube.radius_b_m * tube.radius_b_m);
  }
  return tubes;
}

}  // namespace angio::registration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"

namespace angio::test {

/// T_view_first of a second C-arm that looks at right angles at what stands 0.75 m before the first one's source.
inline Pose fromTheSide() {
  const Eigen::Translation3d to_centre(0, 0, 0.75);
  return to_centre * expSE3((Twist() << 0, 0, 0, 0, kPi / 2, 0).finished()) * to_centre.inverse();
}

}  // namespace angio::test

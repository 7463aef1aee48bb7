// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/geometry/se3.hpp"
#include "angio/test/namespace.hpp"

namespace angio::test {

/// T_view_first of a second C-arm that looks at right angles at what stands 0.75 m before the first one's source.
inline Pose fromTheSide() {
  const Eigen::Translation3d to_center(0, 0, 0.75);
  return to_center * expSE3((Twist() << 0, 0, 0, 0, kPi / 2, 0).finished()) * to_center.inverse();
}

}  // namespace angio::test

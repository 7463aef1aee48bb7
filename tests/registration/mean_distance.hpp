// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/test/namespace.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::test {

inline double meanDistance(const VesselTree& tree, const Pose& a, const Pose& b) {
  return ((a * tree.points()) - (b * tree.points())).colwise().norm().mean();
}

}  // namespace angio::test

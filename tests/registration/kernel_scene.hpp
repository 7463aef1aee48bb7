// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <utility>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {

/// A tree, a pose of it, and what a camera sees of it there.
struct KernelScene {
  VesselTree tree;
  XrayCamera camera = clinicalCamera();
  Pose truth;
  Centerline2d image;

  explicit KernelScene(unsigned seed, XrayCamera seen_by = clinicalCamera())
      : tree(branchingTree(seed)), camera(std::move(seen_by)) {
    Random random(seed + 200);
    truth = viewOf(tree, random);
    image = projectedCenterline(tree, camera, truth);
  }
};

}  // namespace angio::test

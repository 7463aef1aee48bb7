// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/benchmarks/namespace.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::benchmarks {

/// A real hepatic tree under a C-arm at LAO 30 / CRA 15, its centroid at the isocentre, with a clean image of itself.
struct Scene {
  VesselTree tree = readVesselTree(test::exampleData("hepatic-tace/tree.csv"));
  CArmGeometry carm;
  XrayCamera camera = carm.camera();
  Pose truth = carm.T_camera_patient(carm.jointsFor({degToRad(30), degToRad(15)}, tree.centroid()));
  Centerline2d image = projectedCenterline(resampled(tree, 0.5e-3, 100000).tree, camera, truth);

  /// The true pose turned and shifted by these amounts, about and along fixed directions.
  Pose start(double rotation_deg, double translation_mm) const {
    test::Random random(1);
    Twist off;
    off << 1e-3 * translation_mm * random.direction(), degToRad(rotation_deg) * random.direction();
    return test::perturbed(truth, tree, off);
  }

  /// The tree with about `points` points.
  VesselTree treeOf(int points) const { return resampled(tree, 1e-5, points).tree; }

  /// The image with about `points` points, in equal steps along the tree.
  Centerline2d imageOf(int points) const { return projectedCenterline(treeOf(points), camera, truth); }
};

}  // namespace angio::benchmarks

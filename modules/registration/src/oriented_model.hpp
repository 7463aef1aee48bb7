// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "angio/registration/oriented_kernel_settings.hpp"
#include "angio/vessel/resample.hpp"
#include "field_step.hpp"

namespace angio::registration {

/// The model side of a registration: what is computed once per tree.
struct OrientedModel {
  OrientedModel(const VesselTree& given, const OrientedKernelSettings& settings);

  ResampledTree resampled;
  Eigen::Vector3d centroid;                ///< [m], model frame.
  Eigen::Matrix3Xd points;                 ///< 3 x N, about the centroid [m].
  std::vector<std::pair<int, int>> edges;  ///< Parent and child, columns of `points`.
  double spacing_m = 0;                    ///< Length of the tree a point.
  double radius_m = 0;                     ///< Root mean square distance of the points from the centroid.

  /// All points, and evenly chosen ones: about 128, 256, 512, 1024 of them.
  ModelPoints all;
  std::vector<ModelPoints> subsets;

  int size() const { return static_cast<int>(points.cols()); }
};

}  // namespace angio::registration

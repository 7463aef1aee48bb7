// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/simulation/namespace.hpp"
#include "angio/simulation/patient_settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::simulation {

/// A catheter or guidewire: a radio-opaque round line, with an optional marker at its tip.
struct Device {
  Eigen::Matrix3Xd points;  ///< 3 x N, at least 2, the tip last; model frame [m].
  double diameter_m = 1e-3;
  double attenuation_per_m = 150;  ///< Linear, above blood's.
  double marker_length_m = 0;      ///< At the tip; 0: none.
  double marker_attenuation_per_m = 0;

  /// Throws InputError that names the field: too few points, numbers that are not finite or not positive.
  void check() const;
};

/// Points of the tree from its root to `point`, root first. Throws InputError when there is no such point.
std::vector<int> pathFromRoot(const VesselTree& tree, int point);

/// Ends of the tree, those farthest from their root along the tree first.
std::vector<int> endsByDistance(const VesselTree& tree);

/// The first `length_m` [m] of a line through the tree's points `path`, which stand at 3 x N `points`; all of it when
/// it is shorter. It keeps the line's own corners.
Eigen::Matrix3Xd alongPath(const Eigen::Matrix3Xd& points, const std::vector<int>& path, double length_m);

/// The device in the tree whose points stand at `points`, with `inserted_m` [m] of it inside; nothing of kind kNone.
/// `path` is its way from the root.
std::vector<Device> deviceInTree(const DeviceSettings& settings, const Eigen::Matrix3Xd& points,
                                 const std::vector<int>& path, double inserted_m);

}  // namespace angio::simulation

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "angio/base/settings.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio {

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

enum class DeviceKind { kNone, kCatheter, kGuidewire };

/// A device that is pushed into the tree. Unless set, it has the size and opacity of what it is: a catheter of 5 French
/// (1.67 mm, its wall filled with barium), or a guidewire of 0.014 inch of steel with 20 mm of platinum coil at its tip
/// (NIST XCOM at 60 keV: steel 0.95, platinum 8 per mm).
struct DeviceSettings {
  DeviceKind kind = DeviceKind::kNone;
  static constexpr double diameter_factor = 1;  ///< Of the usual diameter.
  static constexpr double opacity_factor = 1;   ///< Of the usual attenuation.
  int tip_branch = 0;         ///< Which end of the tree it goes for: 0 the farthest from its root, 1 the next...
  double inserted_mm = 60;    ///< Length inside the tree at the first frame; it ends where the tree does.
  double speed_mm_per_s = 0;  ///< Of pushing (or, if negative, pulling).

  void visit(SettingsVisitor& v) {
    v.choice("kind", kind, {"none", "catheter", "guidewire"});
    v.integer("tip_branch", tip_branch, 0, 100000);
    v.number("inserted_mm", inserted_mm, 1, 3000);
    v.number("speed_mm_per_s", speed_mm_per_s, -200, 200);
  }
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

}  // namespace angio

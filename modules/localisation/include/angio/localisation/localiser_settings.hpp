// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/localisation/namespace.hpp"

namespace angio::localisation {

/// Settings of CatheterLocaliser.
struct LocaliserSettings {
  // Places and motion.
  double spacing_mm = 1;           ///< Between places on the tree.
  double max_speed_mm_per_s = 60;  ///< Of the tip along the vessel, when nothing says how far it was pushed.
  static constexpr double speed_std_mm_per_s = 10;  ///< The same, usual size.
  static constexpr double slip_std = 0.3;  ///< Share of a pushed length that friction and bends take or give back.
  double backlash_mm = 0.5;                ///< Motion of the tip that no push explains, a frame.
  static constexpr double jump_probability = 1e-6;  ///< That the filter was wrong and the tip is anywhere.

  // The image's shift against the pose: a walk that comes back to zero.
  double shift_std_mm = 3;  ///< Per axis, at the tip's depth.
  double shift_time_s = 2;  ///< In which it forgets itself.
  double scale_std_percent =
      0.5;  ///< Of the image's size against the pose's, besides the pose's covariance; anew each frame.
  double roll_std_deg = 0.5;  ///< Of its turn in the image, the same.

  // When a belief is sure.
  double near_mm = 1.5;        ///< Places within this of each other are one.
  double min_probability = 0;  ///< That the tip is so near to the believed place; below, the belief is unsure.

  // How a curve resembles a path.
  static constexpr double step_px = 10;  ///< Between the points of the curve that are looked at.
  double model_std_px = 2;  ///< Of the vessel's place besides the curve's own noise: the tree is not quite rigid.
  static constexpr double tip_std_px = 3;       ///< Of the seen tip along the vessel.
  double outlier_px = 12;                       ///< Points of the curve further off than this count no more.
  static constexpr double correlation_px = 40;  ///< Along the curve over which its errors are one and the same.
  double lost_px = 15;                          ///< A mean distance above this explains nothing.

  void visit(SettingsVisitor& v) {
    v.number("spacing_mm", spacing_mm, 0.1, 20);
    v.number("max_speed_mm_per_s", max_speed_mm_per_s, 0.1, 1000);
    v.number("shift_std_mm", shift_std_mm, 0.01, 100);
  }
};

}  // namespace angio::localisation

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// NICP of the paper's comparison: registration of tubes to images (Aylward, Jomier, Weeks and Bullitt, IJCV 55, 2003),
/// for one or more X-ray views. Rigid only.
struct NicpSettings {
  static constexpr const char* kName = "nicp";

  double first_scale_px = 32;
  double last_scale_px = 1;

  // With one view, scales above this move the tree in the image plane only. The source is for volumes, where a rigid
  // tube keeps its size. A projection does not: where the blur is as wide as the distances between vessels, the metric
  // is largest when the tree recedes and its image shrinks to the densest spot. With a first scale of this or less the
  // whole pose moves at every scale, as in the source.
  static constexpr double in_plane_above_px = 16;

  // Of the model and of the image's centreline, as iterative_pnp has them by default.
  static constexpr double spacing_mm = 1;
  static constexpr double spacing_px = 2;
  static constexpr int max_points_3d = 3000;

  void visit(SettingsVisitor& v) {
    v.number(
        "first_scale_px", first_scale_px, 1, 200,
        "Coarsest blur of the image's centreline, as a standard deviation; scales halve from there. Above 16 px one "
        "view moves the tree in the image plane only");
    v.number("last_scale_px", last_scale_px, 1, 100, "Finest blur of the image's centreline, as a standard deviation");
  }
};

}  // namespace angio::registration

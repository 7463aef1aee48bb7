// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// RGRB, robust gradient-based: gradients at the surface of the tree's vessels against gradients of the X-ray image,
/// matched along the normals, and a motion that most matches agree on. Source: Markelj et al., "Robust gradient-based
/// 3-D/2-D registration of CT and MR to X-ray images", IEEE TMI 27 (2008).
struct RgrbSettings {
  static constexpr const char* kName = "rgrb";
  static constexpr bool kNeedsImage = true;

  double search_mm = 10;

  // Draws of the consensus, and how many matches each takes: six unknowns, and one more.
  static constexpr int draws = 300;
  static constexpr int matches_a_draw = 7;
  static constexpr int seed = 1;
  static constexpr int max_iterations = 40;
  // Of branches whose radius the tree does not know.
  static constexpr double end_radius_mm = 0.6;

  void visit(SettingsVisitor& v) {
    v.number("search_mm", search_mm, 0.1, 100,
             "How far from a vessel's surface a gradient of the image is looked for at first, at the tree's depth");
  }
};

}  // namespace angio::registration

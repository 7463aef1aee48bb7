// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// AutoMask: the X-ray image against digitally reconstructed radiographs of the tree, inside a mask about the projected
/// tree. Source: Steininger et al., "Auto-masked 2D/3D image registration and its validation with clinical cone-beam
/// computed tomography", Phys. Med. Biol. 57 (2012). It compares pixels by their ranks; here they are compared by their
/// values.
struct AutoMaskSettings {
  static constexpr const char* kName = "automask";
  static constexpr bool kNeedsImage = true;

  double mask_margin_mm = 8;

  // First steps of the simplex, of the order of what a start is off.
  static constexpr double step_deg = 2;
  static constexpr double step_mm = 5;
  // Of branches whose radius the tree does not know.
  static constexpr double end_radius_mm = 0.6;

  void visit(SettingsVisitor& v) {
    v.number("mask_margin_mm", mask_margin_mm, 0.5, 100,
             "The mask reaches so far beyond the projected tree, at the tree's depth; half as far at each finer step");
  }
};

}  // namespace angio::registration

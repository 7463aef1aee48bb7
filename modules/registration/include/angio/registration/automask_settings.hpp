// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/registration/namespace.hpp"

namespace angio::registration {

/// How AutoMask compares two images inside its mask.
enum class MaskMetric {
  kRanks,        ///< Correlation of the pixels' ranks (Spearman): the source's choice.
  kCorrelation,  ///< Normalised cross-correlation.
};

/// AutoMask: the X-ray image against digitally reconstructed radiographs of the tree, inside a mask about the projected
/// tree. Source: Steininger et al., "Auto-masked 2D/3D image registration and its validation with clinical cone-beam
/// computed tomography", Phys. Med. Biol. 57 (2012).
struct AutoMaskSettings {
  static constexpr const char* kName = "automask";
  static constexpr bool kNeedsImage = true;

  MaskMetric metric = MaskMetric::kCorrelation;
  double mask_margin_mm = 8;

  // First steps of the simplex, of the order of what a start is off.
  static constexpr double step_deg = 2;
  static constexpr double step_mm = 5;
  // Of branches whose radius the tree does not know.
  static constexpr double end_radius_mm = 0.6;

  void visit(SettingsVisitor& v) {
    v.choice("metric", metric, {"ranks", "correlation"}, "How images are compared: by their pixels' ranks or values");
    v.number("mask_margin_mm", mask_margin_mm, 0.5, 100,
             "The mask reaches so far beyond the projected tree, at the tree's depth; half of it on finer images");
  }
};

}  // namespace angio::registration

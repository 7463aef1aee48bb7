// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

enum class Polarity { kDark, kBright };  ///< How vessels stand out from the background.

/// The paper's segmentation (section III-A): background flattening, Otsu's threshold, thinning to centrelines.
///
/// Lengths are in pixels of the image. Absorption is the natural logarithm of how much a vessel weakens the beam: 0.1
/// is a vessel 10 % darker than its surroundings.
struct OtsuSettings {
  static constexpr const char* kName = "otsu";

  Polarity polarity = Polarity::kDark;
  static constexpr double background_px =
      48;                     ///< Width of what counts as background structure; must exceed the widest vessel [px].
  double smoothing_px = 1.5;  ///< Standard deviation of the noise filter before the threshold [px].
  static constexpr double faintest_absorption =
      0.02;  ///< Weaker contrast is never a vessel, however little noise there is.
  static constexpr double noise_factor =
      4;                          ///< A vessel stands out from the background's spread by this factor at its strongest.
  double branch_contrast = 0.12;  ///< Thin branches reach on from vessels down to this part of Otsu's threshold.
  double min_branch_px = 12;      ///< Shorter branches with a free end are spurs and are dropped; from the wall [px].
  double smallest_area_px = 60;   ///< Smaller connected regions are noise, smaller holes are closed [px^2].
  double border_px = 4;           ///< Margin of the detector that is not looked at [px].
  double spacing_px = 2;          ///< Distance between points of the result [px].

  void visit(SettingsVisitor& v) {
    v.choice("polarity", polarity, {"dark", "bright"});
    v.number("smoothing_px", smoothing_px, 0, 20);
    v.number("branch_contrast", branch_contrast, 0.01, 1);
    v.number("min_branch_px", min_branch_px, 0, 1000);
    v.number("smallest_area_px", smallest_area_px, 0, 1e6);
    v.number("border_px", border_px, 0, 1000);
    v.number("spacing_px", spacing_px, 0.5, 50);
  }
};

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include "angio/base/settings.hpp"
#include "angio/imaging/namespace.hpp"

namespace angio::imaging {

enum class Polarity { kDark, kBright };  ///< How vessels stand out from the background.

/// Where the otsu extractor parts vessels from the background.
enum class OtsuCut {
  kGated,  ///< At a part of Otsu's threshold of the pixels that stand out from the noise, and never within the noise.
  kPlain,  ///< At Otsu's threshold of all pixels, as the paper names it.
};

/// The paper's segmentation (section III-A): background flattening, Otsu's threshold, thinning to centrelines. Its cut
/// is by default ours and no longer Otsu's alone: vessels cover a few per cent of an image, and the plain threshold
/// parts strong vessels from faint ones, or halves the noise.
///
/// Lengths are in pixels of the image. Absorption is the natural logarithm of how much a vessel weakens the beam: 0.1
/// is a vessel 10 % darker than its surroundings.
struct OtsuSettings {
  static constexpr const char* kName = "otsu";

  Polarity polarity = Polarity::kDark;
  OtsuCut cut = OtsuCut::kGated;
  static constexpr double background_px =
      48;  ///< Width of what counts as background structure; must exceed the widest vessel [px].
  double smoothing_px = 1.5;
  static constexpr double faintest_absorption =
      0.02;  ///< Weaker contrast is never a vessel, however little noise there is.
  static constexpr double noise_factor =
      4;  ///< A vessel stands out from the background's spread by this factor at its strongest.
  double branch_contrast = 0.12;
  double min_branch_px = 12;
  double min_area_px = 60;
  double border_px = 4;
  double spacing_px = 2;

  void visit(SettingsVisitor& v) {
    v.choice("polarity", polarity, {"dark", "bright"}, "How vessels stand out from the background");
    v.choice("cut", cut, {"gated", "plain"},
             "The threshold: a part of Otsu's of what stands out from the noise, or Otsu's of all pixels");
    v.number("smoothing_px", smoothing_px, 0, 20, "Standard deviation of the noise filter before the threshold");
    v.number("branch_contrast", branch_contrast, 0.01, 1,
             "With cut gated: thin branches reach on from vessels down to this part of Otsu's threshold");
    v.number("min_branch_px", min_branch_px, 0, 1000,
             "Shorter branches with a free end are spurs and are dropped; measured from the wall");
    v.number("min_area_px", min_area_px, 0, 1e6,
             "Smaller connected regions are noise, smaller holes are closed; in square pixels");
    v.number("border_px", border_px, 0, 1000, "Margin of the detector that is not looked at");
    v.number("spacing_px", spacing_px, 0.5, 50, "Distance between points of the result");
  }
};

/// Vessels as dark ridges of the logarithm of the image, sought at several scales at once.
///
/// Second derivatives of a Gaussian scale space find lines by their bend, whatever the slope they lie on, and both of
/// their flanks have to rise, which the edges of ribs, organs and collimators do not. Thresholds are multiples of the
/// noise that each part of the image shows at each scale, so that they follow the dose. Each line is then fitted, all
/// along, with the shadow of a tube: position, radius, contrast, and how sure the position is; then once more without
/// the shadows of the others, for in the logarithm the image is their sum.
///
/// Catheters and guidewires are told from vessels (Centerline2d::kind) by what they absorb per length, when both are
/// there: guidewires wherever they are, catheters where they come in at the border. What could be either, such as a
/// catheter no denser than the vessels beside it, is taken for a vessel.
///
/// Lengths are in pixels of the image. Absorption is the natural logarithm of how much a vessel weakens the beam: 0.1
/// is a vessel 10 % darker than its surroundings. Sources: Steger, An unbiased detector of curvilinear structures, PAMI
/// 20 (1998); Lindeberg, Edge detection and ridge detection with automatic scale selection, IJCV 30 (1998).
struct RidgeSettings {
  static constexpr const char* kName = "ridge";

  Polarity polarity = Polarity::kDark;
  double max_radius_px = 20;
  static constexpr double noise_factor = 1.7;  ///< A line's pixels stand out from the noise by this factor.
  static constexpr double line_factor = 4;     ///< A whole line stands out by this one at least, on average.
  static constexpr double evidence =
      30;  ///< Least mean salience times square root of the length in radii, of what hangs together.
  static constexpr double faintest_absorption =
      0.015;  ///< Weaker contrast is never a vessel, however little noise there is.
  static constexpr double relative_contrast =
      0.1;                        ///< Nor is one that is weaker than this part of the image's strong vessels.
  double relative_density = 0.6;  ///< Nor a faint line whose contrast over width is below this part of what is usual.
  double min_branch_px = 4;
  static constexpr double min_line_px = 40;  ///< Shorter lines that stand alone are dropped [px].
  static constexpr double max_gap_px = 24;   ///< Wider gaps between two ends of one line stay open [px].
  double border_px = 4;
  double spacing_px = 2;
  // A finer grid tells thin vessels from their neighbours that are a few pixels away, as the brain's are; the time goes
  // with its square.
  int working_side_px = 704;

  void visit(SettingsVisitor& v) {
    v.choice("polarity", polarity, {"dark", "bright"}, "How vessels stand out from the background");
    v.number("max_radius_px", max_radius_px, 1, 500,
             "Radius of the widest vessel; with the image's size it says how coarse the coarsest scale is");
    v.number("min_branch_px", min_branch_px, 0, 1000,
             "Shorter branches with a free end are spurs and are dropped; measured from the wall");
    v.number("border_px", border_px, 0, 1000,
             "Margin of the detector, and of the collimator's opening, that is not looked at");
    v.number("spacing_px", spacing_px, 0.5, 50, "Distance between points of the result");
    v.integer("working_side_px", working_side_px, 64, 4096,
              "Shorter side of the grid that larger images are shrunk to");
    v.fixed("relative_density", relative_density, 0, 1);
  }
};

}  // namespace angio::imaging

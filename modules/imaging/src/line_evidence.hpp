// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "centre_lines.hpp"

namespace angio::imaging {

/// What tells a vessel's line from clutter's, in the order of `LineEvidence::terms`.
constexpr std::array<std::string_view, 9> kEvidenceTerms = {"clarity",  "contrast", "density",    "length", "gap",
                                                            "tree_gap", "bow",      "unevenness", "step"};

/// What one line shows, all of it against the image itself, so that it follows the image's noise, contrast and size.
struct LineEvidence {
  /// Logarithms, within the range that occurs in marked images:
  ///
  /// - clarity: the line's radius over the standard deviation of its position, which noise and clutter beside it make;
  /// - contrast: over that of the image's strong vessels, wide ones such as an aorta left out;
  /// - density: contrast over radius, over the median of all points of vessels;
  /// - length of all lines that hang together with it, over the image's side;
  /// - gap from that group to a longer one, which a fragment of a tree is near;
  /// - tree_gap: from the line to the group that shows most, the tree, which borders of organs and leads are far from;
  /// - bow: the farthest that it leaves its chord, over its length; borders of organs and leads are straight;
  /// - unevenness: the median change of its radius along it, over its radius;
  /// - step: how unlike its flanks are, over its contrast; an organ's or the collimator's edge is a step, a vessel has
  ///   the same on both sides.
  std::array<float, kEvidenceTerms.size()> terms{};

  float contrast = 0;          ///< Median, of the image's logarithm.
  float contrast_part = 0;     ///< Over that of the strong vessels.
  float density_part = 0;      ///< Over the usual one.
  bool is_wide = false;        ///< Wider than the vessels that the weights were learnt from.
  bool most_are_wide = false;  ///< Most of what the image shows is.
  bool stands_alone = false;   ///< Neither end is at another line.
};

/// Evidence on each line, devices included, which are no measure of what vessels are like. `side` is the working
/// image's shorter side [working px].
std::vector<LineEvidence> evidenceOf(const std::vector<CentreLine>& lines, float side);

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"

namespace angio::imaging {

/// Drops lines that are more likely the image's clutter than vessels.
///
/// A line's log odds are linear in its evidence. The weights are those of a logistic regression on five real angiograms
/// whose vessels had been marked, as they are, with noise added, enlarged, and with their contrast lowered
/// (training/fit_line_evidence.py makes them again).
///
/// Of what is left, ribs, vertebrae and the edges of organs go: lines that are too wide for their contrast, unless no
/// bone is so dark or their odds are high. Their density, contrast over radius, is below `least_density` times that of
/// all points of vessels; one with neither end at another line must be denser. Where a
/// vessel is expected the odds are better, and a line is no bone.
///
/// Devices stay. What is left may be judged once more: clutter hangs together as vessels do, and lends length to what
/// it touches. `side` is the working image's shorter side [working px].
void dropUnlikely(std::vector<CentreLine>& lines, float side, float least_density);

}  // namespace angio::imaging

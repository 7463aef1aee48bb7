// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"

namespace angio::imaging {

/// Drops lines that are more likely the image's clutter than vessels.
///
/// A line's log odds are linear in the logarithms of what it shows, all of it against the image itself, so that they
/// follow its noise, its contrast and its size:
///
/// - how clearly it is seen: its radius over the standard deviation of its position, which noise and clutter beside it
///   make;
/// - its contrast, over that of the image's strong vessels, wide ones such as an aorta left out;
/// - the length of all lines that hang together with it, over `side`, the working image's shorter side [working px];
/// - how far that group is from a longer one, which a fragment of a tree is near;
/// - its bend: borders of organs and leads are straight.
///
/// The weights are those of a logistic regression on real angiograms whose vessels had been marked, as they are, with
/// noise added, enlarged, and with their contrast lowered.
///
/// Of what is left, ribs, vertebrae and the edges of organs go: lines that are too wide for their contrast, unless no
/// bone is so dark or their odds are high. Their density, contrast over radius, is below `least_density` times that of
/// all points of vessels; one with neither end at another line must be denser. Devices stay, and have no part in what
/// is usual: beside steel all vessels would be faint and dilute.
/// Where a vessel is expected the odds are better, and a line is no bone.
void dropUnlikely(std::vector<CentreLine>& lines, float side, float least_density);

}  // namespace angio::imaging

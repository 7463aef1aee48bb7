// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "angio/evaluation/namespace.hpp"
#include "angio/vessel/centerline2d.hpp"

namespace angio::evaluation {

/// The shadow of a vessel across its axis: its radius [px] and its absorption through the axis.
struct ShadowProfile {
  double radius_px = 1;
  double contrast = 0;
};

/// Whether the sum of two parallel vessels' shadows has a minimum between their axes. Without one there is a single
/// line to be seen: Sparrow's limit (Sparrow, On spectroscopic resolving power, Astrophys J 44, 1916), 2 sigma for
/// equal normal curves. Shadows are a circle's chords under a blur of standard deviation `blur_px`; no noise.
bool resolved(const ShadowProfile& one, const ShadowProfile& other, double apart_px, double blur_px);

/// For each point of the projected vessels of a frame (with branch, radius and contrast) whether it has a line of its
/// own there: false where another branch runs along within Sparrow's limit and the one line that both cast lies nearer
/// to that one's axis. The nearer axis keeps the line, both do where it lies in the middle. Branches that meet at more
/// than 30 degrees are taken for resolved: either is seen on both sides of the other. Looks at the truth alone, so that
/// it is the same for every extractor. Throws InputError where radius or contrast is missing.
std::vector<bool> haveOwnLine(const Centerline2d& vessels, double blur_px);

/// Which points lie in the shadow of a wider vessel, as a branch does before it leaves its trunk: there is no line of
/// their own to be seen there.
std::vector<bool> lostInAWider(const Centerline2d& vessels);

}  // namespace angio::evaluation

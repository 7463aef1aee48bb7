// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"

namespace angio::imaging {

/// Finds catheters among the lines of one image, without its clutter, and sets their kind; a line that is a catheter
/// first and a vessel then is cut in two.
///
/// Catheters come in at the border of the open part (a range for each row), are as wide all along, and have hardly a
/// branch. One is told by either
///
/// - what it absorbs per length, contrast over radius: half as much again as the other lines do, over `shortest`
///   working pixels at least;
/// - its shape: as wide all along over a fifth more, and likelier a catheter than an artery by that, its density, its
///   tip, its branches, and how its width and contrast change. Of several such lines one is told, if no dense one is.
///
/// From there it goes on, over what crosses it and from line to line, to where what follows is wider or darker as a
/// vessel at its tip is, or bends as no catheter does.
///
/// A vessel lost costs a registration more than a device kept, which is one stray curve: what could be either, such as
/// a catheter no denser than the vessels whose tip is in none, or one in a frame without vessels, stays a vessel.
void tellCatheters(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest);

}  // namespace angio::imaging

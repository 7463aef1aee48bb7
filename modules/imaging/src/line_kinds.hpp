// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"

namespace angio::imaging {

/// Drops lines that follow the border of the open part: what is left of its shadow's edge.
void dropAlongBorder(std::vector<CentreLine>& lines, const std::vector<RowRange>& open);

/// Finds catheters and guidewires among the lines of one image and sets their kind; a line that is a device first and a
/// vessel then is cut in two.
///
/// A device absorbs more over a length than blood with contrast agent in it: contrast over radius tells. What blood
/// absorbs is measured on other lines of the same image, the wider ones of which bring as much length as the device,
/// and it is steady along a device, as its width is. Two kinds are told:
///
/// - wires, as thin as the image resolves and nearly twice as dense as the wider lines, wherever they are;
/// - catheters, which come in at the border of the open part (a range for each row) and have hardly a branch: half as
///   dense again as the other lines over `shortest` working pixels at least, or as wide all along over a fifth more, to
///   a tip at which a wider vessel begins.
///
/// A vessel lost costs a registration more than a device kept, which is one stray curve: what could be either, such as
/// a catheter no denser than the vessels whose tip is in none, or one in a frame without vessels, stays a vessel.
void tellDevices(std::vector<CentreLine>& lines, const std::vector<RowRange>& open, float shortest);

}  // namespace angio::imaging

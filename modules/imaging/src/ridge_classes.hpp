// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "field_outline.hpp"

namespace angio::imaging {

/// A row of lines: how strong the line at each pixel is, and as a multiple of the noise; and which blocks hold any
/// (LinePlane).
struct LinePixels {
  const float *strength, *salience;
  const std::uint8_t* marks;
  int width = 0;
};

/// The classes of Hysteresis in a part of a row: 1 where a line is stronger than `weakest`, 2 where it also stands out
/// from the noise by more than `strong_salience`. What is 0 is left out where a whole block is.
void classifyRidge(const LinePixels& pixels, const RowRange& part, float weakest, float strong_salience,
                   std::uint8_t* to);

/// Adds to `values` the strength of each pixel that stands out from the noise by more than `strong_salience`.
void addSalient(const LinePixels& pixels, float strong_salience, std::vector<float>& values);

}  // namespace angio::imaging

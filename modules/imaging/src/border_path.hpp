// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "centre_lines.hpp"
#include "field_outline.hpp"

namespace angio::imaging {

/// Medians along a line are taken over so many points, so that a crossing vessel does not end what is even, and every
/// so many points.
constexpr std::size_t kWindow = 33, kWindowStep = kWindow / 4;

/// A line that comes in at the border of the open part, and the lines that go on from its far end one after the other:
/// straight on and as wide. What crosses a catheter, or lies beside it, cuts its line into pieces.
struct BorderPath {
  struct Piece {
    std::size_t line = 0;
    std::size_t size = 0;   ///< Points.
    bool reversed = false;  ///< The path runs along the line from its last point to its first.
  };
  CentreLine whole;           ///< From the border on; its kind and step are not set.
  std::vector<Piece> pieces;  ///< In order.
  std::size_t begin = 0;      ///< Where it leaves the border, or what lies beside it, that it first followed.
  std::size_t bend = 0;       ///< The next point at which it bends more sharply than a catheter, or its size.

  bool has(std::size_t line) const;
};

/// The path whose first piece is this line; without pieces where it comes in with neither end. Devices are no pieces.
BorderPath pathFromBorder(const std::vector<CentreLine>& lines, std::size_t own, const std::vector<RowRange>& open);

/// Whether the points [from, to) of a path are like others.
using IsAlike = std::function<bool(std::size_t from, std::size_t to)>;

/// The end of the part of a path, from `begin` on, whose windows are alike; `begin` where none is. A stretch of up to
/// two windows that is not does not end it, where `run` points that are follow; a sharp bend does.
std::size_t alikeUntil(const BorderPath& path, std::size_t begin, std::size_t run, const IsAlike& alike);

/// The same without a stretch that is not alike.
std::size_t evenUntil(const BorderPath& path, std::size_t begin, const IsAlike& alike);

}  // namespace angio::imaging

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <vector>

#include "border_path.hpp"

namespace angio::imaging {

/// Points [begin, end) of a path.
struct PathPart {
  std::size_t begin = 0, end = 0;
  std::size_t size() const { return end - begin; }
};

/// At a catheter's tip begins a vessel that is so many times as wide.
constexpr float kOstium = 1.25f;

/// What ends so near to a tip, beyond the radius, is at it [working px].
constexpr float kTip = 5;

/// What is left of a line after its catheter is no vessel's line of its own if it is shorter [points].
constexpr std::size_t kRest = 22;

/// The first point of a path that the border does not change.
std::size_t firstPoint(const BorderPath& path);

/// How far half of a part's radii, and no more, are from their median, over it.
float radiusScatter(const CentreLine& line, const PathPart& part);

/// To where a path is as wide from the border on as its first `shortest` points, and has their contrast; 0 for a
/// shorter one, and for one whose width is no tube's.
std::size_t evenPart(const BorderPath& path, std::size_t shortest);

/// The longest part of a path that is as wide as a catheter: vessels taper. Without points where none has `shortest`.
PathPart steadyPart(const BorderPath& path, std::size_t shortest);

/// The number of a path's points from the border to the catheter's tip; a part of it is known to be the catheter. It
/// goes on from there while it is as wide, to where a vessel begins that is wider or, among other lines, darker.
std::size_t pointsToTip(const std::vector<CentreLine>& lines, const BorderPath& path, const PathPart& part,
                        std::size_t shortest);

}  // namespace angio::imaging

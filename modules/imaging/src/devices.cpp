// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/imaging/devices.hpp"

#include <algorithm>
#include <cmath>

namespace angio::imaging {
namespace {

constexpr double kNear_px = 2;
constexpr double kTurned_rad = 0.5;

// Points of a branch that must lie on the other frame's lines.
constexpr double kMost = 0.7;

bool liesOn(const Centerline2d& found, int i, const Centerline2d& lines) {
  const double radius = found.radius_px.size() > 0 ? found.radius_px[i] : 0, reach = std::max(kNear_px, radius);
  for (int j = 0; j < lines.size(); ++j) {
    if ((lines.points_px.col(j) - found.points_px.col(i)).squaredNorm() > reach * reach) continue;
    if (std::abs(undirected(lines.tangent_rad[j] - found.tangent_rad[i])) < kTurned_rad) return true;
  }
  return false;
}

}  // namespace

Centerline2d withDevicesOf(const Centerline2d& found, const Centerline2d& in_mask) {
  Centerline2d result = found;
  // Lines of the mask frame closer together than the smallest reach.
  const Centerline2d lines = densified(in_mask, kNear_px);
  result.kind.assign(static_cast<std::size_t>(found.size()), CurveKind::kVessel);
  for (int first = 0, last = 0; first < found.size(); first = last) {
    int on = 0;
    for (last = first; last < found.size() && (!found.ordered() || found.branch[last] == found.branch[first]); ++last) {
      on += liesOn(found, last, lines) ? 1 : 0;
      if (!found.ordered()) {
        ++last;
        break;
      }
    }
    if (on < kMost * (last - first)) continue;
    std::fill(result.kind.begin() + first, result.kind.begin() + last, CurveKind::kDevice);
  }
  return result;
}

}  // namespace angio::imaging

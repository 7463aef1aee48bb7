// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/uncoded_phantom.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/io/table.hpp"

namespace angio::calibration {
namespace {

constexpr std::size_t kMinUncodedBeads = 8, kMaxUncodedBeads = 200;
constexpr double kFarthestBead_m = 1, kSmallestExtent_m = 0.01, kSamePlace_m = 0.5e-3;
constexpr double kNamedWithin = 0.02;  // Of the detector's width, between a named place and a detection.
constexpr double kNearShare = 0.35;    // Of the phantom's extent, between where two poses put its beads.
constexpr double kNearerThan = 0.6;    // A pose's distance to the nearest reading, of that to the next.

void requirePlace(const TableRow& row, const BeadPhantom& phantom, const Eigen::Vector3d& p_m) {
  if (!(p_m.cwiseAbs().maxCoeff() <= kFarthestBead_m)) {
    throw InputError(row.place(), "x, y, z", formatted("%.6g m", p_m.cwiseAbs().maxCoeff()),
                     "must be within 1 m of the origin: is the unit right?");
  }
  for (std::size_t i = 0; i < phantom.beads.size(); ++i) {
    if ((phantom.beads[i].position_m - p_m).norm() > kSamePlace_m) continue;
    throw InputError(row.place(), "x, y, z", "", "must not be the place of bead " + std::to_string(i));
  }
}

// How far apart two poses put the beads, on average [m].
double distanceOf_m(const BeadPhantom& phantom, const Pose& a, const Pose& b) {
  double sum = 0;
  for (const Bead& bead : phantom.beads) sum += (a * bead.position_m - b * bead.position_m).norm();
  return sum / static_cast<double>(phantom.beads.size());
}

std::size_t detectionAt(const std::string& place, const UncodedView& view, const Eigen::Vector2d& at_px, int bead) {
  Eigen::Index nearest = 0;
  const double distance_px = (view.pinhole_px.colwise() - at_px).colwise().norm().minCoeff(&nearest);
  if (distance_px <= kNamedWithin * view.width_px) return static_cast<std::size_t>(nearest);
  throw InputError(place, "bead " + std::to_string(bead), "", "no bead was found near the place that is named");
}

using Readings = std::vector<const PhantomReading*>;

Readings thoseNamed(const std::string& place, const std::vector<PhantomReading>& readings, const UncodedView& view,
                    const ReadingHint& hint) {
  Readings right, mirrored;
  std::vector<std::pair<std::size_t, int>> named;
  for (const auto& [at_px, bead] : hint.named) named.emplace_back(detectionAt(place, view, at_px, bead), bead);
  for (const PhantomReading& reading : readings) {
    const bool agrees = std::all_of(named.begin(), named.end(), [&](const std::pair<std::size_t, int>& known) {
      return reading.bead[known.first] == known.second;
    });
    if (agrees) (reading.mirrored ? mirrored : right).push_back(&reading);
  }
  if (!right.empty()) return right;
  if (!mirrored.empty()) {
    throw InputError(place, "named beads", std::to_string(named.size()),
                     "fit a mirrored picture only: flip the pictures (--mirrored), or the phantom's file is mirrored");
  }
  throw InputError(place, "named beads", std::to_string(named.size()),
                   "are in none of the " + std::to_string(readings.size()) +
                       " readings that fit: do the rows of the phantom's file stand in another order?");
}

// The reading with its pose nearest to the hint's, if it is near and no other is about as near.
Readings thatNear(const std::string& place, const BeadPhantom& phantom, Readings readings, const Pose& T_near) {
  const auto distance_m = [&](const PhantomReading* r) { return distanceOf_m(phantom, r->T_camera_phantom, T_near); };
  std::sort(readings.begin(), readings.end(),
            [&](const auto* a, const auto* b) { return distance_m(a) < distance_m(b); });
  const Eigen::Matrix3Xd centered = phantom.positions_m().colwise() - phantom.center_m();
  const double extent_m = 2 * centered.colwise().norm().maxCoeff(), nearest_m = distance_m(readings.front());
  if (!(nearest_m <= kNearShare * extent_m)) {
    throw InputError(place, "pose", formatted("%.4g mm", 1e3 * nearest_m),
                     formatted("is too far from the nearest reading, more than %.4g mm", 1e3 * kNearShare * extent_m));
  }
  if (readings.size() > 1 && nearest_m > kNearerThan * distance_m(readings[1])) return {readings[0], readings[1]};
  return {readings.front()};
}

}  // namespace

BeadPhantom readPointPhantom(const std::string& path, std::optional<double> unit_m) {
  BeadPhantom phantom;
  phantom.name = std::filesystem::path(path).stem().string();
  readTable(path, {{}, {"x", "y", "z", "x_mm", "y_mm", "z_mm"}}, [&](const TableRow& row) {
    const bool in_mm = row.has("x_mm") && row.has("y_mm") && row.has("z_mm");
    if (!in_mm && !(row.has("x") && row.has("y") && row.has("z"))) {
      throw InputError(row.place(), "columns", "", "must be x_mm, y_mm, z_mm, or x, y, z");
    }
    if (!in_mm && !unit_m) {
      throw InputError(path, "x, y, z", "",
                       "have no unit: say which (--phantom-unit), or name the columns x_mm, y_mm, z_mm");
    }
    const double unit = in_mm ? 1e-3 : *unit_m;
    const Eigen::Vector3d p_m =
        unit * (in_mm ? Eigen::Vector3d(row.number("x_mm"), row.number("y_mm"), row.number("z_mm"))
                      : Eigen::Vector3d(row.number("x"), row.number("y"), row.number("z")));
    if (phantom.beads.size() == kMaxUncodedBeads)
      throw InputError(row.place(), "", "", "there must not be more than 200 beads");
    requirePlace(row, phantom, p_m);
    phantom.beads.push_back({p_m, 0});
  });
  if (phantom.beads.size() < kMinUncodedBeads) {
    throw InputError(path, "beads", std::to_string(phantom.beads.size()), "must be at least 8");
  }
  const Eigen::Matrix3Xd centered = phantom.positions_m().colwise() - phantom.center_m();
  if (centered.colwise().norm().maxCoeff() < kSmallestExtent_m) {
    throw InputError(path, "beads", "", "must spread over more than 10 mm: is the unit right?");
  }
  if (phantom.isPlanar()) throw InputError(path, "beads", "", "must not lie in one plane");
  return phantom;
}

PhantomReading chosenReading(const std::string& place, const BeadPhantom& phantom,
                             const std::vector<PhantomReading>& readings, const UncodedView& view,
                             const ReadingHint& hint) {
  Readings left = thoseNamed(place, readings, view, hint);
  if (hint.T_near) left = thatNear(place, phantom, left, *hint.T_near);
  if (left.size() == 1) return *left.front();
  const auto mirrored =
      std::count_if(readings.begin(), readings.end(), [](const PhantomReading& r) { return r.mirrored; });
  throw InputError(
      place, "readings", std::to_string(left.size()),
      formatted(
          "fit equally well (and %td in a mirrored picture): the beads are equal and the phantom is its own image "
          "turned or shifted; name some beads that are seen (--known-beads), or say a pose nearby (--near)",
          mirrored));
}

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/coverage.hpp"

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "nearest_point.hpp"

namespace angio::volume {
namespace {

struct Samples {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> lengths;  // Of the piece of line that each stands in the middle of.
  std::vector<double> radii;    // 0 where unknown.
};

Samples samplesOf(const VesselTree& tree, double spacing_m) {
  Samples samples;
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[i];
    if (parent < 0) continue;
    const Eigen::Vector3d from = tree.points().col(parent), along = tree.points().col(i) - from;
    const int pieces = std::max(1, static_cast<int>(std::ceil(along.norm() / spacing_m)));
    for (int k = 0; k < pieces; ++k) {
      samples.points.emplace_back(from + (k + 0.5) / pieces * along);
      samples.lengths.push_back(along.norm() / pieces);
      samples.radii.push_back(tree.radii()[i].value_or(0));
    }
  }
  return samples;
}

}  // namespace

Coverage coverage(const VesselTree& tree, const VesselTree& other, double distance_m, CoverageScope scope) {
  requirePositive("coverage", "distance_m", distance_m);
  const double spacing_m = distance_m / 10;
  const Samples mine = samplesOf(tree, spacing_m), its = samplesOf(other, spacing_m);
  const NearestPoint nearest(Eigen::Map<const Eigen::Matrix3Xd>(its.points.front().data(), 3, its.points.size()));
  std::vector<double> distances;
  double near = 0, all = 0;
  for (std::size_t i = 0; i < mine.points.size(); ++i) {
    const NearestPoint::Found found = nearest.find(mine.points[i]);
    if (scope == CoverageScope::kInsideOther && found.distance > its.radii[found.index]) continue;
    distances.push_back(found.distance);
    all += mine.lengths[i];
    if (distances.back() <= distance_m) near += mine.lengths[i];
  }
  if (distances.empty()) return {};
  std::sort(distances.begin(), distances.end());
  return {near / all, distances[distances.size() / 2], distances.back()};
}

}  // namespace angio::volume

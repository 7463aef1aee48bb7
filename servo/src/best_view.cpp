// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/best_view.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "angio/base/errors.hpp"
#include "segment_views.hpp"

namespace angio::servo {
namespace {

const std::string kPlace = "best view";
constexpr double kFinestStep_rad = degToRad(0.05);
constexpr double kAskew_rad = degToRad(5);  // What a patient may lie askew and a best view still be in reach.

void check(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene) {
  if (segment.size() < 2) throw InputError(kPlace, "segment", "", "must have two points at least");
  double length_m = 0;
  for (std::size_t k = 0; k < segment.size(); ++k) {
    const int point = segment[k];
    if (point < 0 || point >= tree.size()) {
      throw InputError(kPlace, "segment", std::to_string(point), "the tree has no such point");
    }
    if (k == 0) continue;
    if (tree.parents()[static_cast<std::size_t>(point)] != segment[k - 1]) {
      throw InputError(kPlace, "segment", std::to_string(point), "must be a child of the point before it");
    }
    length_m += (tree.points().col(point) - tree.points().col(segment[k - 1])).norm();
  }
  requirePositive(kPlace, "segment length_mm", 1e3 * length_m);
  requirePositive(kPlace, "source_isocentre_distance_mm", 1e3 * scene.source_isocenter_distance_m);
  if (!(rotationDefect(scene.R_lps_model) < 1e-6)) {
    throw InputError(kPlace, "R_lps_model", "", "must be a rotation matrix");
  }
}

// Cost with its tie-breaker, over views that can be reached.
class Search {
 public:
  Search(const SegmentViews& views, const BestViewScene& scene, const BestViewSettings& settings)
      : views_(views), scene_(scene), settings_(settings) {}

  bool reachable(const ViewAngles& angles) const {
    return std::abs(radToDeg(angles.primary_rad)) <= settings_.max_primary_deg + 1e-9 &&
           std::abs(radToDeg(angles.secondary_rad)) <= settings_.max_secondary_deg + 1e-9 &&
           (!scene_.reachable || scene_.reachable(angles));
  }
  double total(const ViewAngles& angles, const ViewCost& cost) const {
    const double cosine = std::clamp(beamDirection(angles).dot(beamDirection(scene_.near)), -1.0, 1.0);
    return cost.foreshortening + settings_.overlap_weight * cost.overlap +
           settings_.turn_weight * std::acos(cosine) / degToRad(90);
  }
  /// Downhill from a node, in steps that are halved (pattern search).
  void refine(BestView& best, double step_rad) const {
    double least = total(best.angles, best.cost);
    while (step_rad > kFinestStep_rad) {
      bool moved = false;
      for (const auto& [p, s] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
        const ViewAngles next{best.angles.primary_rad + p * step_rad, best.angles.secondary_rad + s * step_rad};
        if (!reachable(next)) continue;
        const ViewCost cost = views_.cost(next);
        if (total(next, cost) >= least) continue;
        least = total(next, cost);
        best.angles = next;
        best.cost = cost;
        moved = true;
      }
      if (!moved) step_rad *= 0.5;
    }
  }

 private:
  const SegmentViews& views_;
  const BestViewScene& scene_;
  const BestViewSettings& settings_;
};

}  // namespace

TreeSegment segmentOfBranch(const VesselTree& tree, int branch) {
  const auto count = static_cast<int>(tree.branches().size());
  if (branch < 0 || branch >= count) {
    throw InputError(kPlace, "branch", std::to_string(branch), "must be below " + std::to_string(count));
  }
  return tree.branches()[static_cast<std::size_t>(branch)];
}

TreeSegment segmentBetween(const VesselTree& tree, int first, int last) {
  for (const int point : {first, last}) {
    if (point < 0 || point >= tree.size()) {
      throw InputError(kPlace, "segment", std::to_string(point), "the tree has no such point");
    }
  }
  TreeSegment segment;
  for (int point = last; point >= 0; point = tree.parents()[static_cast<std::size_t>(point)]) {
    segment.push_back(point);
    if (point == first) break;
  }
  if (segment.back() != first || segment.size() < 2) {
    throw InputError(kPlace, "segment", std::to_string(last), "must lie downstream of point " + std::to_string(first));
  }
  std::reverse(segment.begin(), segment.end());
  return segment;
}

BestViewScene bestViewScene(const CArmGeometry& carm, const CArmLimits& limits, const Eigen::Matrix3d& R_lps_model) {
  BestViewScene scene;
  scene.R_lps_model = R_lps_model;
  scene.source_isocenter_distance_m = carm.source_isocenter_distance_m;
  scene.reachable = [carm, limits](const ViewAngles& angles) {
    const CArmJoints joints = carm.jointsFor(angles, Eigen::Vector3d::Zero());
    const Eigen::Array2d turned = joints.head<2>().array();
    return (turned >= limits.lower.head<2>().array() + kAskew_rad).all() &&
           (turned <= limits.upper.head<2>().array() - kAskew_rad).all() && !limits.envelope.violated(joints);
  };
  return scene;
}

BestView bestView(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene,
                  const BestViewSettings& settings) {
  checkSettings(kPlace, settings);
  check(tree, segment, scene);
  const SegmentViews views(tree, segment, scene, settings);
  const Search search(views, scene, settings);
  BestView best;
  best.target_model = views.middle_model();
  ViewMap& map = best.map;
  // Whole steps from zero, so that the map is symmetric.
  const auto steps = [&](double max_deg) { return static_cast<int>(std::floor(max_deg / settings.step_deg + 1e-9)); };
  const int columns = steps(settings.max_primary_deg), rows = steps(settings.max_secondary_deg);
  map.step_rad = degToRad(settings.step_deg);
  map.first_primary_rad = -columns * map.step_rad;
  map.first_secondary_rad = -rows * map.step_rad;
  map.foreshortening.setZero(2 * rows + 1, 2 * columns + 1);
  map.overlap = map.foreshortening;
  map.reachable.setConstant(2 * rows + 1, 2 * columns + 1, false);
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index j = 0; j < map.overlap.cols(); ++j) {
    for (Eigen::Index i = 0; i < map.overlap.rows(); ++i) {
      const ViewAngles angles{map.primary_rad(j), map.secondary_rad(i)};
      if (!search.reachable(angles)) continue;
      const ViewCost cost = views.cost(angles);
      map.reachable(i, j) = true;
      map.foreshortening(i, j) = static_cast<float>(cost.foreshortening);
      map.overlap(i, j) = static_cast<float>(cost.overlap);
      if (const double total = search.total(angles, cost); total < least) {
        least = total;
        best.angles = angles;
        best.cost = cost;
      }
    }
  }
  if (!std::isfinite(least)) throw InputError(kPlace, "range", "", "no view is reachable");
  search.refine(best, 0.5 * map.step_rad);
  return best;
}

}  // namespace angio::servo

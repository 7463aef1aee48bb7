// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/best_view.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "angio/base/errors.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::servo {
namespace {

/// A segment and the tree around it, laid out so that one view costs some ten microseconds.
class SegmentViews {
 public:
  SegmentViews(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene,
               const BestViewSettings& settings);

  ViewCost cost(const ViewAngles& angles) const;

  const Eigen::Vector3d& middle_model() const { return middle_; }

 private:
  struct Tube {  // One point of a vessel in the image, scaled to the isocentre's distance [m].
    float x, y, r;
    Eigen::Index point;
  };
  float covered(Eigen::Index sample, const Tube& image, const std::vector<Tube>& near) const;

  double source_isocenter_distance_m_;
  Eigen::Vector3d middle_;
  Eigen::Matrix3Xf samples_, tangents_;  // Of the segment, patient axes about its middle [m].
  Eigen::ArrayXf lengths_m_, radii_m_;   // Of what each sample stands for; its radius.
  Eigen::Matrix3Xf others_;              // The tree's points, the same axes.
  Eigen::ArrayXf other_radii_m_;
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> joined_;  // By sample and point.
};

constexpr double kFinestStep_m = 0.5e-3;  // Finer than any vessel that an X-ray shows is wide.
constexpr double kJoinedRadii = 4;        // Along the tree, in sums of both radii: nearer points touch in every view.

struct Place {
  Eigen::Vector3d position, tangent;
  double length_m, radius_m;
  int point;  // Of the tree, the nearest upstream.
};

double radiusAt(const VesselTree& tree, int point, double unknown_m) {
  return tree.radii()[static_cast<std::size_t>(point)].value_or(unknown_m);
}

// `count` places in equal steps of arc length, each in the middle of its piece.
std::vector<Place> placesOn(const VesselTree& tree, const TreeSegment& segment, int count, double unknown_radius_m) {
  double whole_m = 0;
  for (std::size_t k = 1; k < segment.size(); ++k) {
    whole_m += (tree.points().col(segment[k]) - tree.points().col(segment[k - 1])).norm();
  }
  std::vector<Place> places;
  double walked_m = 0;
  for (std::size_t k = 1; k < segment.size(); ++k) {
    const Eigen::Vector3d a = tree.points().col(segment[k - 1]), b = tree.points().col(segment[k]);
    const double edge_m = (b - a).norm();
    while (static_cast<int>(places.size()) < count) {
      const double at_m = (static_cast<double>(places.size()) + 0.5) * whole_m / count - walked_m;
      if (at_m > edge_m && k + 1 < segment.size()) break;
      const double share = edge_m > 0 ? std::min(1.0, at_m / edge_m) : 0.0;
      const double radius_m = (1 - share) * radiusAt(tree, segment[k - 1], unknown_radius_m) +
                              share * radiusAt(tree, segment[k], unknown_radius_m);
      const Eigen::Vector3d tangent = edge_m > 0 ? Eigen::Vector3d((b - a) / edge_m) : Eigen::Vector3d::Zero();
      places.push_back({a + share * (b - a), tangent, whole_m / count, radius_m, segment[k - 1]});
    }
    walked_m += edge_m;
  }
  return places;
}

// Along the tree from one point, as far as `max_m`: distances [m], infinite beyond.
std::vector<double> alongTree(const VesselTree& tree, int from, double max_m) {
  std::vector<double> distance_m(static_cast<std::size_t>(tree.size()), std::numeric_limits<double>::infinity());
  std::vector<int> waiting{from};
  distance_m[static_cast<std::size_t>(from)] = 0;
  while (!waiting.empty()) {
    const int at = waiting.back();
    waiting.pop_back();
    const auto visit = [&](int next) {
      const double d =
          distance_m[static_cast<std::size_t>(at)] + (tree.points().col(next) - tree.points().col(at)).norm();
      if (d > max_m || d >= distance_m[static_cast<std::size_t>(next)]) return;
      distance_m[static_cast<std::size_t>(next)] = d;
      waiting.push_back(next);
    };
    if (const int parent = tree.parents()[static_cast<std::size_t>(at)]; parent >= 0) visit(parent);
    for (const int child : tree.children()[static_cast<std::size_t>(at)]) visit(child);
  }
  return distance_m;
}

SegmentViews::SegmentViews(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene,
                           const BestViewSettings& settings)
    : source_isocenter_distance_m_(scene.source_isocenter_distance_m) {
  const double unknown_m = 1e-3 * settings.unknown_radius_mm;
  const std::vector<Place> places = placesOn(tree, segment, settings.segment_points, unknown_m);
  middle_ = places[places.size() / 2].position;
  const auto n = static_cast<Eigen::Index>(places.size());
  samples_.resize(3, n);
  tangents_.resize(3, n);
  lengths_m_.resize(n);
  radii_m_.resize(n);
  const double step_m = std::max(kFinestStep_m, tree.length() / settings.max_points);
  const VesselTree thinned = resampled(tree, step_m, settings.max_points).tree;
  others_ = (scene.R_lps_model * (thinned.points().colwise() - middle_)).cast<float>();
  other_radii_m_.resize(thinned.size());
  double widest_m = 0;
  for (int j = 0; j < thinned.size(); ++j) {
    other_radii_m_[j] = static_cast<float>(radiusAt(thinned, j, unknown_m));
    widest_m = std::max(widest_m, static_cast<double>(other_radii_m_[j]));
  }
  joined_.setConstant(n, thinned.size(), false);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Place& place = places[static_cast<std::size_t>(i)];
    samples_.col(i) = (scene.R_lps_model * (place.position - middle_)).cast<float>();
    tangents_.col(i) = (scene.R_lps_model * place.tangent).cast<float>();
    lengths_m_[i] = static_cast<float>(place.length_m);
    radii_m_[i] = static_cast<float>(place.radius_m);
    Eigen::Index nearest = 0;
    const double off_m =
        std::sqrt((thinned.points().colwise() - place.position).colwise().squaredNorm().minCoeff(&nearest));
    const auto along_m =
        alongTree(thinned, static_cast<int>(nearest), kJoinedRadii * (place.radius_m + widest_m) + off_m);
    for (int j = 0; j < thinned.size(); ++j) {
      const double touching_m = kJoinedRadii * (place.radius_m + static_cast<double>(other_radii_m_[j]));
      if (along_m[static_cast<std::size_t>(j)] - off_m < touching_m) joined_(i, j) = true;
    }
  }
}

ViewCost SegmentViews::cost(const ViewAngles& angles) const {
  const Eigen::Matrix3f R = viewRotation(angles).cast<float>();
  const auto distance_m = static_cast<float>(source_isocenter_distance_m_);
  // Images as they are at the isocentre's distance [m].
  const auto image = [&](const Eigen::Vector3f& turned, float radius_m) {
    const float scale = distance_m / (turned.z() + distance_m);
    return Tube{turned.x() * scale, turned.y() * scale, radius_m * scale, 0};
  };
  const Eigen::Matrix3Xf turned = R * samples_, other = R * others_;
  float seen_m = 0;
  Eigen::AlignedBox2f around;
  std::vector<Tube> samples(static_cast<std::size_t>(samples_.cols()));
  for (Eigen::Index i = 0; i < samples_.cols(); ++i) {
    const Tube tube = samples[static_cast<std::size_t>(i)] = image(turned.col(i), radii_m_[i]);
    around.extend(Eigen::Vector2f(tube.x - tube.r, tube.y - tube.r));
    around.extend(Eigen::Vector2f(tube.x + tube.r, tube.y + tube.r));
    const Eigen::Vector3f ray = (turned.col(i) + Eigen::Vector3f(0, 0, distance_m)).normalized();
    seen_m += lengths_m_[i] * std::min((R * tangents_.col(i)).cross(ray).norm(), 1.0f);
  }
  std::vector<Tube> near;  // Most of the tree lies beside the segment.
  for (Eigen::Index j = 0; j < other.cols(); ++j) {
    Tube tube = image(other.col(j), other_radii_m_[j]);
    tube.point = j;
    if (around.squaredExteriorDistance(Eigen::Vector2f(tube.x, tube.y)) < tube.r * tube.r) near.push_back(tube);
  }
  float covered_m = 0;
  for (Eigen::Index i = 0; i < samples_.cols(); ++i) {
    covered_m += lengths_m_[i] * covered(i, samples[static_cast<std::size_t>(i)], near);
  }
  const float whole_m = lengths_m_.sum();
  return {std::max(0.0, 1.0 - static_cast<double>(seen_m / whole_m)), static_cast<double>(covered_m / whole_m)};
}

// The share of a sample's width that the vessel which covers most of it covers.
float SegmentViews::covered(Eigen::Index i, const Tube& sample, const std::vector<Tube>& near) const {
  float most = 0;
  for (const Tube& tube : near) {
    const float dx = tube.x - sample.x, dy = tube.y - sample.y, touching = tube.r + sample.r;
    const float apart2 = dx * dx + dy * dy;
    if (apart2 >= touching * touching || joined_(i, tube.point)) continue;
    most = std::max(most, std::min({touching - std::sqrt(apart2), 2 * tube.r, 2 * sample.r}));
  }
  return most / (2 * sample.r);
}

const std::string kPlace = "best view";
constexpr double kFinestStep_rad = degToRad(0.05);
constexpr double kAskew_rad = degToRad(5);  // What a patient may lie askew and a best view still be in reach.

void requirePoint(const VesselTree& tree, int point) {
  if (point >= 0 && point < tree.size()) return;
  throw InputError(kPlace, "segment", std::to_string(point), "the tree has no such point");
}

void check(const VesselTree& tree, const TreeSegment& segment, const BestViewScene& scene) {
  if (segment.size() < 2) throw InputError(kPlace, "segment", "", "must have two points at least");
  double length_m = 0;
  for (std::size_t k = 0; k < segment.size(); ++k) {
    const int point = segment[k];
    requirePoint(tree, point);
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
           settings_.turn_weight * std::acos(cosine) / degToRad(90) +
           (scene_.other_cost ? scene_.other_cost(angles) : 0.0);
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
  for (const int point : {first, last}) requirePoint(tree, point);
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

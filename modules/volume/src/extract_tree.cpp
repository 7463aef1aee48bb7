// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/extract_tree.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>

#include "angio/base/errors.hpp"
#include "angio/base/joined.hpp"
#include "angio/volume/shape.hpp"
#include "angio/volume/thinning.hpp"
#include "centring.hpp"
#include "nearest_point.hpp"

namespace angio::volume {
namespace {

// Points of the result as they are found [index of the volume].
struct Points {
  std::vector<Eigen::Vector3d> at;
  std::vector<int> parents;
  std::vector<double> radii;

  int add(const Eigen::Vector3d& point, int parent) {
    at.push_back(point);
    parents.push_back(parent);
    return static_cast<int>(at.size()) - 1;
  }
};

// Equal steps of about `spacing` from one place of a path to another, behind the point `last`; the last one's number.
int addSteps(const std::vector<Eigen::Vector3d>& path, std::size_t from, std::size_t to, double spacing, int last,
             Points& points) {
  double length = 0;
  for (std::size_t i = from; i < to; ++i) length += (path[i + 1] - path[i]).norm();
  const int steps = std::max(1, static_cast<int>(std::lround(length / spacing)));
  double behind = 0;  // Length up to path[i].
  std::size_t i = from;
  for (int k = 1; k <= steps; ++k) {
    const double wanted = length * k / steps;
    double edge = (path[i + 1] - path[i]).norm();
    while (i + 1 < to && behind + edge < wanted) {
      behind += edge;
      ++i;
      edge = (path[i + 1] - path[i]).norm();
    }
    const double share = k == steps ? 1 : std::min(1.0, (wanted - behind) / std::max(edge, 1e-12));
    last = points.add(path[i] + share * (path[i + 1] - path[i]), last);
  }
  return last;
}

// A path's points between forks, each fork being a point. Two forks in one place stay one.
void addPath(const std::vector<CenteredPath>& paths, std::size_t p, const std::vector<std::vector<int>>& forks,
             double spacing, std::vector<std::vector<int>>& point_at, Points& points) {
  const CenteredPath& path = paths[p];
  auto& mine = point_at[p];
  mine.assign(path.points.size(), -1);
  mine[0] = path.parent < 0 ? points.add(path.points[0], -1) : point_at[path.parent][path.parent_place];
  std::size_t from = 0;
  for (const std::size_t to : forks[p]) {
    if (to == from) continue;
    mine[to] = addSteps(path.points, from, to, spacing, mine[from], points);
    from = to;
  }
}

// Which of the openings a point lies in, the nearest; none.
const Opening* openingAt(const std::vector<Opening>& openings, const Eigen::Vector3d& point_m) {
  const Opening* best = nullptr;
  for (const Opening& o : openings) {
    const double distance_m = (o.middle_m - point_m).norm();
    if (distance_m < o.radius_m && (!best || distance_m < (best->middle_m - point_m).norm())) best = &o;
  }
  return best;
}

// Leads ends that lie in an opening to its middle, from a radius away or from the next fork.
void endInOpenings(const std::vector<Opening>& openings, const VoxelGrid& grid, std::vector<CenteredPath>& paths) {
  std::vector<std::size_t> first_fork(paths.size(), SIZE_MAX), last_fork(paths.size(), 0);
  for (const CenteredPath& path : paths) {
    if (path.parent < 0) continue;
    const std::size_t place = path.parent_place;
    first_fork[path.parent] = std::min(first_fork[path.parent], place);
    last_fork[path.parent] = std::max(last_fork[path.parent], place);
  }
  const auto within = [&](const Opening& o, const Eigen::Vector3d& index) {
    return (grid.pointAt(index) - o.middle_m).norm() < o.radius_m;
  };
  for (std::size_t p = 0; p < paths.size(); ++p) {
    auto& points = paths[p].points;
    if (const Opening* const o = openingAt(openings, grid.pointAt(points.back()))) {
      while (points.size() > last_fork[p] + 1 && points.size() > 1 && within(*o, points.back())) points.pop_back();
      points.push_back(grid.indexAt(o->middle_m));
    }
    const Opening* const o = paths[p].parent < 0 ? openingAt(openings, grid.pointAt(points.front())) : nullptr;
    if (!o) continue;
    const std::size_t most = std::min(first_fork[p] - 1, points.size() - 2);
    std::size_t cut = 0;
    while (cut < most && within(*o, points[cut + 1])) ++cut;
    points.erase(points.begin(), points.begin() + static_cast<long>(cut));
    points.front() = grid.indexAt(o->middle_m);
    for (CenteredPath& child : paths) {
      if (child.parent == static_cast<int>(p)) child.parent_place -= static_cast<int>(cut);
    }
  }
}

// The places of each path where it is cut to segments: forks and its end, rising.
std::vector<std::vector<int>> cutsOf(const std::vector<CenteredPath>& paths) {
  std::vector<std::vector<int>> cuts(paths.size());
  for (const CenteredPath& path : paths) {
    if (path.parent >= 0) cuts[path.parent].push_back(path.parent_place);
  }
  for (std::size_t p = 0; p < paths.size(); ++p) {
    cuts[p].push_back(static_cast<int>(paths[p].points.size()) - 1);
    std::sort(cuts[p].begin(), cuts[p].end());
  }
  return cuts;
}

std::vector<std::vector<int>> linksOf(const Points& points) {
  std::vector<std::vector<int>> links(points.at.size());
  for (std::size_t i = 0; i < points.at.size(); ++i) {
    const int parent = points.parents[i];
    if (parent < 0) continue;
    links[i].push_back(parent);
    links[parent].push_back(static_cast<int>(i));
  }
  return links;
}

// From an end on to the first point whose sphere touches the vessel's sides and no longer the end's wall: from there on
// it does not grow like the way. No further than to a fork.
std::vector<std::size_t> chainFromEnd(const Points& points, const std::vector<std::vector<int>>& links,
                                      const std::vector<double>& spheres, std::size_t end) {
  constexpr double kGrowth = 0.4;  // Of a flat end it is the cosine of its tilt, of a tapering vessel far less.
  std::vector<std::size_t> chain = {end};
  for (;;) {
    const std::size_t at = chain.back();
    if (chain.size() > 1 && links[at].size() != 2) break;
    const bool came_by_first = chain.size() > 1 && links[at][0] == static_cast<int>(chain[chain.size() - 2]);
    const std::size_t next = links[at][came_by_first ? 1 : 0];
    if (spheres[next] - spheres[at] < kGrowth * (points.at[next] - points.at[at]).norm()) break;
    chain.push_back(next);
  }
  return chain;
}

// The largest spheres. At a wall there is none: up to a radius from an end, the radius is the one further in.
void setRadii(const std::vector<double>& spheres, Points& points) {
  const auto links = linksOf(points);
  points.radii = spheres;
  for (std::size_t end = 0; end < links.size(); ++end) {
    if (links[end].size() != 1) continue;
    const auto chain = chainFromEnd(points, links, spheres, end);
    double radius = spheres[chain.back()];
    for (const int next : links[chain.back()]) radius = std::max(radius, spheres[next]);
    for (const std::size_t i : chain) points.radii[i] = std::max(points.radii[i], radius);
  }
}

// Ends the lines where the sphere touches the end's wall.
Points withoutCaps(const Points& points, const std::vector<double>& spheres) {
  const auto links = linksOf(points);
  std::vector<bool> keep(points.at.size(), true);
  std::vector<int> parents = points.parents;
  for (std::size_t end = 0; end < links.size(); ++end) {
    if (links[end].size() != 1) continue;
    const auto chain = chainFromEnd(points, links, spheres, end);
    if (links[chain.back()].size() != 2) continue;  // A fork within a radius: the branch would be gone.
    for (std::size_t i = 0; i + 1 < chain.size(); ++i) keep[chain[i]] = false;
    if (points.parents[end] < 0) parents[chain.back()] = -1;
  }
  Points result;
  std::vector<int> now(points.at.size(), -1);
  for (std::size_t i = 0; i < points.at.size(); ++i) {  // Parents stand before their children.
    if (!keep[i]) continue;
    now[i] = result.add(points.at[i], parents[i] < 0 ? -1 : now[parents[i]]);
    result.radii.push_back(points.radii[i]);
  }
  return result;
}

VesselTree treeOf(const Points& points, const VoxelGrid& grid) {
  Eigen::Matrix3Xd points_m(3, points.at.size());
  std::vector<std::optional<double>> radii_m;
  for (std::size_t i = 0; i < points.at.size(); ++i) {
    points_m.col(i) = grid.pointAt(points.at[i]);
    radii_m.emplace_back(points.radii[i] * grid.spacing_m.x());
  }
  return {std::move(points_m), points.parents, std::move(radii_m)};
}

const char* doneAbout(Flaw flaw) {
  switch (flaw) {
    case Flaw::kCycle:
      return "cut where it is thinnest";
    case Flaw::kSelfTouch:
      return "cut where it touches";
    case Flaw::kKissing:
      return "parted";
    default:
      return "dropped";
  }
}

// In the patient, the longest of each kind first.
std::vector<Repair> repairsOf(const SkeletonForest& forest, const VoxelGrid& grid) {
  const double voxel_m = grid.spacing_m.x();
  std::vector<Repair> repairs;
  for (const SkeletonRepair& r : forest.repairs) {
    repairs.push_back({r.flaw, grid.pointAt(r.at), r.length * voxel_m, r.radius * voxel_m, 1, doneAbout(r.flaw)});
  }
  std::stable_sort(repairs.begin(), repairs.end(), [](const Repair& a, const Repair& b) {
    return a.flaw != b.flaw ? a.flaw < b.flaw : a.length_m > b.length_m;
  });
  return repairs;
}

void refuseCycles(const std::vector<Repair>& repairs) {
  std::vector<Repair> cycles;
  std::copy_if(repairs.begin(), repairs.end(), std::back_inserter(cycles),
               [](const Repair& r) { return r.flaw == Flaw::kCycle || r.flaw == Flaw::kSelfTouch; });
  if (cycles.empty()) return;
  std::vector<std::string> places;
  for (const Repair& r : cycles) places.push_back(repairPlace(r, PatientFrame::kLps));
  throw InputError("vessels", "cycles", std::to_string(cycles.size()),
                   "must be none where they are refused; L, P, S [mm]: " + joined(places, 5, "; "));
}

SkeletonForest treesOf(SkeletonGraph graph, const CentrelineSettings& settings, double voxel_mm,
                       const std::optional<Eigen::Vector3d>& root) {
  const auto forestOf = [&] {
    return withoutSpurs(linked(graph, settings.kissing, root), settings.min_branch_mm / voxel_mm,
                        settings.min_branch_radii);
  };
  SkeletonForest forest = forestOf();
  if (std::none_of(forest.cut.begin(), forest.cut.end(), [](bool cut) { return cut; })) return forest;
  // Loops are cut far from the roots, and which ends are the thickest is seen when loops are cut and spurs are gone.
  markRoots(forest, root, graph);
  return forestOf();
}

}  // namespace

int ExtractedTree::count(Flaw flaw) const {
  return static_cast<int>(
      std::count_if(repairs.begin(), repairs.end(), [&](const Repair& r) { return r.flaw == flaw; }));
}

ExtractedTree extractTree(const Volume& shape, const CentrelineSettings& settings,
                          const std::optional<Eigen::Vector3d>& root_m, const ExtractionProgress& progress,
                          const std::vector<Opening>& openings) {
  checkSettings("centreline", settings);
  const auto begin = [&](int stage, const char* name) {
    if (progress) progress(stage, name);
  };
  begin(0, "equal voxels");
  const double voxel_m = settings.voxel_mm > 0 ? settings.voxel_mm / 1e3 : shape.grid.spacing_m.minCoeff();
  const double voxel_mm = 1e3 * voxel_m;
  const Volume fine = isotropic(shape, voxel_m);
  VoxelMask mask{fine.grid, std::vector<std::uint8_t>(fine.values.size())};
  for (std::size_t i = 0; i < fine.values.size(); ++i) mask.inside[i] = fine.values[i] > 0 ? 1 : 0;
  fillHoles(mask);

  begin(1, "distance to the wall");
  const std::vector<float> depth_m = distanceMap(mask, 0);
  begin(2, "thinning");
  const LevelField level(fine);
  const NearestPoint wall(level.wallPoints());
  const std::optional<Eigen::Vector3d> root =
      root_m ? std::optional<Eigen::Vector3d>(fine.grid.indexAt(*root_m)) : std::nullopt;
  const SkeletonGraph graph = graphOf(thinned(mask, depth_m), wall);
  SkeletonForest forest = treesOf(graph, settings, voxel_mm, root);
  if (settings.cycles == CycleRule::kRefuse) refuseCycles(repairsOf(forest, fine.grid));
  forest = withoutSmallTrees(forest, settings.min_tree_mm / voxel_mm);
  if (forest.nodes.empty()) {
    throw InputError("volume", "min_tree_mm", formatValue(settings.min_tree_mm), "no tree is that long");
  }

  begin(3, "centring");
  auto paths =
      centered(level, forest, pathsOf(forest, root), {settings.smoothing_mm / voxel_mm, settings.smoothing_radii});
  endInOpenings(openings, fine.grid, paths);
  begin(4, "points and radii");
  Points points;
  const auto cuts = cutsOf(paths);
  std::vector<std::vector<int>> point_at(paths.size());
  for (std::size_t p = 0; p < paths.size(); ++p) {
    addPath(paths, p, cuts, settings.spacing_mm / voxel_mm, point_at, points);
  }
  constexpr double kMinRadius = 0.5;  // No vessel that voxels show is narrower than one [voxels].
  std::vector<double> spheres;
  for (const auto& point : points.at) spheres.push_back(std::max(kMinRadius, wall.distance(point)));
  setRadii(spheres, points);
  if (settings.ends == CentrelineEnd::kSphere) points = withoutCaps(points, spheres);
  return {treeOf(points, fine.grid), repairsOf(forest, fine.grid)};
}

}  // namespace angio::volume

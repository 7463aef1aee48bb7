// SPDX-License-Identifier: GPL-2.0-or-later
#include "centring.hpp"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "angio/geometry/se3.hpp"

namespace angio::volume {
namespace {

// A path on its way, with the vessel's radius at each node [voxels].
struct Line {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> radii;
  std::vector<double> weights;  // How much the smoothing must keep of each point.
  bool begins_at_fork = false;
  bool begins_at_cut = false, ends_at_cut = false;  // The vessel goes on there.
};

std::size_t reachAt(const Line& line, std::size_t i, double min_nodes) {
  return static_cast<std::size_t>(std::max(min_nodes, std::ceil(line.radii[i])));
}

Eigen::Vector3d tangentAt(const Line& line, std::size_t i) {
  const std::size_t reach = reachAt(line, i, 2), last = line.points.size() - 1;
  const Eigen::Vector3d along = line.points[std::min(i + reach, last)] - line.points[i > reach ? i - reach : 0];
  const double length = along.norm();
  return length > 1e-9 ? Eigen::Vector3d(along / length) : Eigen::Vector3d::UnitX();
}

// Towards the middle of the largest circle in the cross-section: away from the wall where it is nearest. Rays count by
// exp(-length / softness), so that those into a branch or another lobe of a fork do not; of a circle that is off by d
// their weighted mean is -d / (2 softness), in the limit of small d.
Eigen::Vector3d shiftToMiddle(const LevelField& level, const Eigen::Vector3d& point, const Eigen::Vector3d& tangent,
                              double radius) {
  constexpr std::size_t kRays = 24;
  const double softness = std::max(0.4, 0.1 * radius);  // Voxels have no corners that are finer.
  const Eigen::Vector3d u = tangent.unitOrthogonal(), v = tangent.cross(u);
  std::array<double, kRays> lengths;
  std::array<Eigen::Vector3d, kRays> directions;
  for (std::size_t k = 0; k < kRays; ++k) {
    const double angle = 2 * kPi * static_cast<double>(k) / kRays;
    directions[k] = std::cos(angle) * u + std::sin(angle) * v;
    lengths[k] = level.wallDistance(point, directions[k], 2 * radius + 2);
  }
  const double shortest = *std::min_element(lengths.begin(), lengths.end());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0;
  for (std::size_t k = 0; k < kRays; ++k) {
    const double weight = std::exp((shortest - lengths[k]) / softness);
    sum += weight * directions[k];
    weights += weight;
  }
  return -2 * softness / weights * sum;
}

// The smoothest line near the points (Whittaker): sum |x - p|^2 + lambda |second differences|^2. It halves waves of the
// given length and leaves bends that do not change. Fixed ends stay.
void smooth(Line& line, double wavelength) {
  const auto n = static_cast<Eigen::Index>(line.points.size());
  if (n < 4) return;
  double step = 0;
  for (std::size_t i = 1; i < line.points.size(); ++i) step += (line.points[i] - line.points[i - 1]).norm();
  step /= static_cast<double>(n - 1);
  const double lambda = std::pow(wavelength / (2 * kPi * step), 4);
  std::vector<Eigen::Triplet<double>> entries;
  static constexpr double kDifference[3] = {1, -2, 1};
  for (Eigen::Index i = 0; i + 2 < n; ++i) {
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) entries.emplace_back(i + a, i + b, lambda * kDifference[a] * kDifference[b]);
    }
  }
  Eigen::MatrixX3d right(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double weight = i == 0 && line.begins_at_fork ? 1e9 : line.weights[i];
    entries.emplace_back(i, i, weight);
    right.row(i) = weight * line.points[i].transpose();
  }
  Eigen::SparseMatrix<double> left(n, n);
  left.setFromTriplets(entries.begin(), entries.end());
  const Eigen::MatrixX3d smoothed = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(left).solve(right);
  for (Eigen::Index i = 0; i < n; ++i) line.points[i] = smoothed.row(i).transpose();
}

double medianRadius(const Line& line) {
  std::vector<double> radii = line.radii;
  std::nth_element(radii.begin(), radii.begin() + radii.size() / 2, radii.end());
  return radii[radii.size() / 2];
}

void center(const LevelField& level, const Smoothness& smoothness, Line& line) {
  constexpr int kRounds = 6;  // Each moves by up to a fifth of the radius.
  const double wavelength = std::max(smoothness.voxels, smoothness.radii * medianRadius(line));
  line.weights.assign(line.points.size(), 1);
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Eigen::Vector3d> middles = line.points;
    for (std::size_t i = line.begins_at_fork ? 1 : 0; i < middles.size(); ++i) {
      middles[i] += shiftToMiddle(level, line.points[i], tangentAt(line, i), line.radii[i]);
    }
    line.points = middles;
    smooth(line, wavelength);
    for (std::size_t i = 0; i < middles.size(); ++i) {
      if (level.at(line.points[i]) > 0) continue;
      line.points[i] = middles[i];  // Too smooth for a vessel that bends so sharply.
      line.weights[i] *= 100;
    }
  }
}

// How many nodes at the end of a line lead from the middle to the wall: there the depth falls to much less than it is
// a diameter further in.
std::size_t nodesBehindEnd(const std::vector<double>& radii_from_end) {
  constexpr double kFallen = 0.8;
  std::size_t behind = 0;
  for (std::size_t i = 0; i + 1 < radii_from_end.size(); ++i) {
    const auto reach = static_cast<std::size_t>(std::ceil(2 * radii_from_end[i])) + 2;
    const auto inner = std::min(i + reach, radii_from_end.size());
    const double thickest = *std::max_element(radii_from_end.begin() + i, radii_from_end.begin() + inner);
    if (radii_from_end[i] >= kFallen * thickest) break;
    behind = i + 1;
  }
  return behind;
}

// From the last point straight on to the wall.
std::optional<Eigen::Vector3d> wallAhead(const LevelField& level, const Eigen::Vector3d& inner,
                                         const Eigen::Vector3d& end, double radius) {
  const Eigen::Vector3d along = end - inner;
  const double length = along.norm();
  if (length < 1e-9) return std::nullopt;
  const double farthest = 2.5 * radius + 3;
  const double ahead = level.wallDistance(end, along / length, farthest);
  // A way that does not end soon leads into another vessel.
  if (ahead >= farthest || ahead < 0.25) return std::nullopt;
  return end + ahead * along / length;
}

Eigen::Vector3d innerPoint(const Line& line, std::size_t end) {
  const std::size_t reach = std::min(line.points.size() - 1, reachAt(line, end, 3));
  return end == 0 ? line.points[reach] : line.points[end - reach];
}

// What of each path cannot be cut: another one leaves there.
struct Forks {
  std::vector<std::size_t> first, last;  // Places; none: past the end, and 0.

  explicit Forks(const std::vector<SkeletonPath>& paths) : first(paths.size(), SIZE_MAX), last(paths.size(), 0) {
    for (const SkeletonPath& path : paths) {
      if (path.parent < 0) continue;
      const std::size_t p = path.parent, place = path.parent_place;
      last[p] = std::max(last[p], place);
      first[p] = std::min(first[p], place);
    }
  }
};

Line lineOf(const SkeletonForest& forest, const SkeletonPath& path, std::size_t last_fork) {
  Line line;
  line.begins_at_fork = path.parent >= 0;
  for (const int node : path.nodes) {
    line.points.push_back(forest.nodes[node]);
    line.radii.push_back(std::max(0.5, forest.depths[node]));
  }
  line.begins_at_cut = forest.cut[path.nodes.front()];
  line.ends_at_cut = forest.cut[path.nodes.back()];
  if (line.ends_at_cut) return line;
  const std::vector<double> from_end(line.radii.rbegin(), line.radii.rend());
  const std::size_t most = line.points.size() - 1 - std::max<std::size_t>(last_fork, 1);
  line.points.resize(line.points.size() - std::min(nodesBehindEnd(from_end), most));
  line.radii.resize(line.points.size());
  return line;
}

// Takes away what leads from the wall to the middle at a root; how many nodes that are.
std::size_t cutRoot(Line& line, std::size_t first_fork) {
  // A fork must not become the root, which is moved to the wall.
  const std::size_t cut = std::min({nodesBehindEnd(line.radii), first_fork - 1, line.points.size() - 2});
  line.points.erase(line.points.begin(), line.points.begin() + cut);
  line.radii.erase(line.radii.begin(), line.radii.begin() + cut);
  return cut;
}

// A branch is in the middle of its own part of a fork's wide section: it goes along with its parent for two radii and
// leaves it where it is no longer the same line. Returns the place in the parent.
std::size_t centerBranch(const LevelField& level, const Smoothness& smoothness, const Line& parent, std::size_t place,
                         Line& line) {
  const auto reach = static_cast<std::size_t>(std::ceil(2 * parent.radii[place]));
  const std::size_t from = place > reach ? place - reach : 1, shared = place - from;
  line.points.front() = parent.points[place];
  line.points.insert(line.points.begin(), parent.points.begin() + from, parent.points.begin() + place);
  line.radii.insert(line.radii.begin(), parent.radii.begin() + from, parent.radii.begin() + place);
  center(level, smoothness, line);
  std::size_t same = 0;
  while (same < shared) {
    const std::size_t next = same + 1;
    if ((line.points[next] - parent.points[from + next]).norm() > std::max(0.5, 0.1 * line.radii[next])) break;
    same = next;
  }
  line.points.erase(line.points.begin(), line.points.begin() + same);
  line.radii.erase(line.radii.begin(), line.radii.begin() + same);
  line.points.front() = parent.points[from + same];
  return from + same;
}

}  // namespace

std::vector<CenteredPath> centered(const LevelField& level, const SkeletonForest& forest,
                                   const std::vector<SkeletonPath>& paths, const Smoothness& smoothness) {
  const Forks forks(paths);
  std::vector<Line> lines;
  std::vector<CenteredPath> result;
  std::vector<long> moved(paths.size(), 0);  // By how much the places of each path's nodes changed.
  for (std::size_t p = 0; p < paths.size(); ++p) {
    const SkeletonPath& path = paths[p];
    Line line = lineOf(forest, path, forks.last[p]);
    CenteredPath centered_path;
    if (line.begins_at_fork) {
      const std::size_t parent = path.parent, place = path.parent_place + moved[parent];
      centered_path.parent = path.parent;
      centered_path.parent_place = static_cast<int>(centerBranch(level, smoothness, lines[parent], place, line));
      moved[p] = static_cast<long>(place) - centered_path.parent_place;
    } else {
      if (!line.begins_at_cut) moved[p] = -static_cast<long>(cutRoot(line, forks.first[p]));
      center(level, smoothness, line);
    }
    const std::size_t end = line.points.size() - 1;
    centered_path.points = line.points;
    if (!line.ends_at_cut) {
      const auto ahead = wallAhead(level, innerPoint(line, end), line.points[end], line.radii[end]);
      if (ahead) centered_path.points.push_back(*ahead);
    }
    if (!line.begins_at_fork && !line.begins_at_cut) {
      const auto before = wallAhead(level, innerPoint(line, 0), line.points.front(), line.radii.front());
      if (before) centered_path.points.front() = *before;
    }
    lines.push_back(std::move(line));
    result.push_back(std::move(centered_path));
  }
  return result;
}

}  // namespace angio::volume

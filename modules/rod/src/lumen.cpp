// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/rod/lumen.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "angio/base/errors.hpp"

namespace angio::rod {
namespace {

constexpr double kMinEdge_m = 1e-6;      // A shorter edge has no direction.
constexpr double kMaxSlope = 1;          // Of the radius along a tube: where a small vessel leaves a wide one.
constexpr double kRunTogether_m = 8e-3;  // Branches of thinned centrelines share their first millimetres.

constexpr double kPiece_m = 0.7e-3, kPieceOfRadius = 0.35;  // Length of a tube.
constexpr double kStraight = 0.7;                           // Cosine of a turn below which lines do not go on.

constexpr double kSurely = 1 + 1e-9;  // Beyond rounding.

constexpr double kRounding = 1;       // Standard deviation of the mean that rounds an axis, in radii ...
constexpr double kMaxRounding = 0.5;  // ... and how far it may move a point, in radii.
constexpr int kMaxRounds = 200;

// How often a point's place becomes the mean of its own and those beside it: a mean of a quarter, a half and a quarter
// has a variance of half a step squared.
std::vector<int> roundsOf(const VesselTree& tree) {
  std::vector<int> rounds(static_cast<std::size_t>(tree.size()), 0);
  for (const std::vector<int>& branch : tree.branches()) {
    const auto count = static_cast<double>(branch.size());
    double length_m = 0, radius_m = 0;
    for (std::size_t k = 0; k < branch.size(); ++k) {
      radius_m += *tree.radii()[static_cast<std::size_t>(branch[k])] / count;
      if (k > 0) length_m += (tree.points().col(branch[k]) - tree.points().col(branch[k - 1])).norm();
    }
    const double step_m = std::max(length_m / std::max(count - 1, 1.0), kMinEdge_m);
    const auto most =
        static_cast<int>(std::min(std::round(2 * std::pow(kRounding * radius_m / step_m, 2)), 1.0 * kMaxRounds));
    for (const int i : branch)
      rounds[static_cast<std::size_t>(i)] = std::max(rounds[static_cast<std::size_t>(i)], most);
  }
  return rounds;
}

// The tree with its corners rounded, those at forks too: a vessel does not turn in much less than its radius, and the
// axes of segmented ones have that much noise, most of all where thinned lines of voxels meet. Ends stay where they
// are.
VesselTree rounded(const VesselTree& tree) {
  const std::vector<int> rounds = roundsOf(tree);
  const int most = rounds.empty() ? 0 : *std::max_element(rounds.begin(), rounds.end());
  Eigen::Matrix3Xd points = tree.points();
  for (int round = 0; round < most; ++round) {
    const Eigen::Matrix3Xd before = points;
    for (int i = 0; i < tree.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      const std::vector<int>& children = tree.children()[at];
      if (round >= rounds[at] || tree.parents()[at] < 0 || children.empty()) continue;
      Eigen::Vector3d behind = Eigen::Vector3d::Zero();
      for (const int child : children) behind += before.col(child) / static_cast<double>(children.size());
      const Eigen::Vector3d off =
          0.25 * before.col(tree.parents()[at]) + 0.5 * before.col(i) + 0.25 * behind - tree.points().col(i);
      const double room_m = kMaxRounding * *tree.radii()[at];
      points.col(i) = tree.points().col(i) + std::min(1.0, room_m / std::max(off.norm(), kMinEdge_m)) * off;
    }
  }
  return VesselTree(points, tree.parents(), tree.radii());
}

// The point behind the end `b` of an edge that goes on straightest, or -1.
int straightest(const VesselTree& tree, int a, int b) {
  const Eigen::Vector3d along = (tree.points().col(b) - tree.points().col(a)).normalized();
  int best = -1;
  double most = -1;
  for (const int child : tree.children()[static_cast<std::size_t>(b)]) {
    const double straight = (tree.points().col(child) - tree.points().col(b)).normalized().dot(along);
    if (straight > most) most = straight, best = child;
  }
  return best;
}

}  // namespace

Lumen::Lumen(const VesselTree& given) : map_(given), of_branch_(static_cast<std::size_t>(map_.branchCount())) {
  for (const auto& radius_m : given.radii()) {
    if (!radius_m) throw InputError("lumen", "radius", "unknown", "must be known at every point of the tree");
  }
  const VesselTree tree = rounded(given);
  for (int branch = 0; branch < map_.branchCount(); ++branch) {
    const std::vector<int>& points = map_.points(branch);
    double arc_m = 0;
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      const int a = points[k], b = points[k + 1];
      const double arc_length_m = (given.points().col(b) - given.points().col(a)).norm();
      const int before = k > 0 ? points[k - 1] : tree.parents()[static_cast<std::size_t>(a)];
      const int behind = k + 2 < points.size() ? points[k + 2] : straightest(tree, a, b);
      addEdge(tree, {before, a, b, behind}, branch, arc_m, arc_length_m);
      arc_m += arc_length_m;
    }
  }
  findNear();
}

// An edge's tubes, along a cubic whose ends go on into the edges beside it where these go about straight on.
void Lumen::addEdge(const VesselTree& tree, const std::array<int, 4>& points, int branch, double arc_m,
                    double arc_length_m) {
  const auto place = [&](int k) { return Eigen::Vector3d(tree.points().col(points[static_cast<std::size_t>(k)])); };
  const Eigen::Vector3d edge = place(2) - place(1);
  const double length_m = edge.norm();
  if (length_m < kMinEdge_m) return;
  const auto slope = [&](int k) -> Eigen::Vector3d {
    const int other = points[k == 1 ? 0 : 3];
    if (other < 0) return edge;
    const Eigen::Vector3d beside = k == 1 ? Eigen::Vector3d(place(1) - place(0)) : Eigen::Vector3d(place(3) - place(2));
    if (beside.norm() < kMinEdge_m || beside.normalized().dot(edge) < kStraight * length_m) return edge;
    return length_m * (beside.normalized() + edge / length_m).normalized();
  };
  const Eigen::Vector3d from = slope(1), to = slope(2);
  const double radius_a = *tree.radii()[static_cast<std::size_t>(points[1])];
  const double radius_b = *tree.radii()[static_cast<std::size_t>(points[2])];
  const double start_m = std::min(radius_a, radius_b + kMaxSlope * length_m);
  const double end_m = std::min(radius_b, radius_a + kMaxSlope * length_m);
  const double piece_m = std::max(kPiece_m, kPieceOfRadius * std::min(start_m, end_m));
  const int pieces = std::max(1, static_cast<int>(std::lround(length_m / piece_m)));
  Eigen::Vector3d last = place(1);
  for (int k = 0; k < pieces; ++k) {
    const double u = static_cast<double>(k + 1) / pieces, v = 1 - u;
    const Eigen::Vector3d next =
        v * v * (1 + 2 * u) * place(1) + u * u * (1 + 2 * v) * place(2) + u * v * (v * from - u * to);
    Tube tube;
    tube.start = last;
    tube.length_m = (next - last).norm();
    tube.along = (next - last) / tube.length_m;
    tube.start_radius_m = start_m + (k * (end_m - start_m)) / pieces;
    tube.end_radius_m = start_m + u * (end_m - start_m);
    tube.arc_m = arc_m + k * arc_length_m / pieces;
    tube.arc_length_m = arc_length_m / pieces;
    tube.edge = {points[1], points[2], static_cast<double>(k) / pieces};
    tube.edge_share = 1.0 / pieces;
    tube.branch = branch;
    const int inner =
        tree.size() + static_cast<int>(tubes_.size());  // Joints between pieces have numbers of their own.
    tube.joints = {k == 0 ? points[1] : inner - 1, k + 1 == pieces ? points[2] : inner};
    of_branch_[static_cast<std::size_t>(branch)].push_back(static_cast<int>(tubes_.size()));
    tubes_.push_back(std::move(tube));
    last = next;
  }
}

// For each tube the others within some way along the vessels, over forks too: Dijkstra over the tree's points, which
// are few that near.
void Lumen::findNear() {
  std::vector<std::vector<int>> at_point;
  for (std::size_t k = 0; k < tubes_.size(); ++k) {
    const auto most = static_cast<std::size_t>(std::max(tubes_[k].joints[0], tubes_[k].joints[1]));
    if (at_point.size() <= most) at_point.resize(most + 1);
    for (const int end : tubes_[k].joints) at_point[static_cast<std::size_t>(end)].push_back(static_cast<int>(k));
  }
  std::vector<double> reached(at_point.size(), std::numeric_limits<double>::infinity());
  std::vector<int> touched;
  using Way = std::pair<double, int>;
  for (Tube& tube : tubes_) {
    const double reach_m = 2 * std::max(tube.start_radius_m, tube.end_radius_m) + kRunTogether_m;
    std::priority_queue<Way, std::vector<Way>, std::greater<>> front;
    for (const int end : tube.joints) front.push({0, end});
    while (!front.empty()) {
      const auto [way_m, point] = front.top();
      front.pop();
      const auto p = static_cast<std::size_t>(point);
      if (way_m >= reached[p]) continue;
      if (reached[p] == std::numeric_limits<double>::infinity()) touched.push_back(point);
      reached[p] = way_m;
      for (const int k : at_point[p]) {
        const Tube& next = tubes_[static_cast<std::size_t>(k)];
        tube.near.push_back(k);
        const double further_m = way_m + next.length_m;
        if (further_m <= reach_m) front.push({further_m, next.joints[next.joints[0] == point ? 1 : 0]});
      }
    }
    for (const int point : touched) reached[static_cast<std::size_t>(point)] = std::numeric_limits<double>::infinity();
    touched.clear();
    std::sort(tube.near.begin(), tube.near.end());
    tube.near.erase(std::unique(tube.near.begin(), tube.near.end()), tube.near.end());
  }
}

WallGap Lumen::gapNear(int tube, const Eigen::Vector3d& center, double radius_m) const {
  const auto along_m = [&](const Tube& t) { return std::clamp((center - t.start).dot(t.along), 0.0, t.length_m); };
  const auto roomIn = [&](const Tube& t, double s, double off_m) {
    return t.start_radius_m + s / t.length_m * (t.end_radius_m - t.start_radius_m) - off_m;
  };
  const Tube& own = tubes_[static_cast<std::size_t>(tube)];
  const double own_s = along_m(own), own_room = roomIn(own, own_s, (center - own.start - own_s * own.along).norm());
  int best = tube;
  double most = -std::numeric_limits<double>::infinity();
  for (const int k : own.near) {
    const Tube& t = tubes_[static_cast<std::size_t>(k)];
    const double s = along_m(t), off_squared = (center - t.start - s * t.along).squaredNorm();
    // Most are too far off for even their wider end to leave as much room: no root and no quotient for them.
    const double reach_m = std::max(t.start_radius_m, t.end_radius_m) - own_room;
    if (off_squared > kSurely * reach_m * reach_m) continue;
    const double room = roomIn(t, s, std::sqrt(off_squared));
    if (room > most) most = room, best = k;
  }
  WallGap gap = gapIn(tubes_[static_cast<std::size_t>(best)], center, radius_m);
  gap.tube = best;
  return gap;
}

WallGap Lumen::gapIn(const Tube& tube, const Eigen::Vector3d& center, double radius_m) const {
  const Eigen::Vector3d off = center - tube.start;
  const double s = off.dot(tube.along);
  WallGap gap;
  gap.weight = std::clamp(s / tube.length_m, 0.0, 1.0);
  const bool beside = s > 0 && s < tube.length_m;
  const Eigen::Vector3d away = off - gap.weight * tube.length_m * tube.along;
  const double distance = away.norm(), slope = (tube.end_radius_m - tube.start_radius_m) / tube.length_m;
  gap.gap_m = tube.start_radius_m + gap.weight * (tube.end_radius_m - tube.start_radius_m) - distance - radius_m;
  if (beside) gap.gradient = slope * tube.along;
  if (distance < kMinEdge_m) return gap;
  const Eigen::Vector3d out = away / distance;
  gap.gradient -= out;
  gap.curvature = (Eigen::Matrix3d::Identity() - out * out.transpose()) / distance;
  if (beside) gap.curvature -= tube.along * tube.along.transpose() / distance;
  return gap;
}

int Lumen::tubeAt(const TreeLocation& place) const {
  const std::vector<int>& tubes = of_branch_.at(static_cast<std::size_t>(place.branch));
  if (tubes.empty()) throw InputError("lumen", "branch", std::to_string(place.branch), "must have a length");
  const auto beyond = std::upper_bound(tubes.begin(), tubes.end(), place.arc_m, [&](double arc_m, int k) {
    return arc_m < tubes_[static_cast<std::size_t>(k)].arc_m;
  });
  return beyond == tubes.begin() ? tubes.front() : *(beyond - 1);
}

TreeLocation Lumen::place(int tube, double weight) const {
  const Tube& t = tubes_.at(static_cast<std::size_t>(tube));
  return {t.branch, std::min(t.arc_m + weight * t.arc_length_m, map_.length_m(t.branch))};
}

EdgePoint Lumen::edgePoint(int tube, double weight) const {
  const Tube& t = tubes_.at(static_cast<std::size_t>(tube));
  return {t.edge.a, t.edge.b, t.edge.weight + weight * t.edge_share};
}

}  // namespace angio::rod

// SPDX-License-Identifier: GPL-2.0-or-later
#include "closed_shells.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unordered_map>

#include "angio/base/groups.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::volume {
namespace {

using Triangle = std::array<int, 3>;
using Edge = std::pair<int, int>;  // The smaller number first.

Edge edgeOf(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

Repair counted(Flaw flaw, int count, const Eigen::Vector3d& first_mm, const char* done) {
  return {flaw, first_mm / 1e3, 0, 0, count, done};
}

// Each point becomes the first one within the tolerance.
class JoinedPoints {
 public:
  explicit JoinedPoints(double tolerance_mm) : tolerance_mm_(tolerance_mm) {}

  // The number of what a point becomes in points_mm().
  int add(const Eigen::Vector3d& p_mm) {
    const Cell cell = cellOf(p_mm);
    for (int k = 0; k < 27; ++k) {
      const auto found = at_.find({cell[0] + k % 3 - 1, cell[1] + k / 3 % 3 - 1, cell[2] + k / 9 - 1});
      if (found == at_.end()) continue;
      for (const int other : found->second) {
        const double distance_mm = (points_mm_[other] - p_mm).norm();
        if (distance_mm > tolerance_mm_) continue;
        // Equal ones are how files without numbered points say that triangles share a corner.
        if (distance_mm > 0 && moved_.insert({p_mm.x(), p_mm.y(), p_mm.z()}).second) {
          if (moved_.size() == 1) first_mm_ = p_mm;
          farthest_mm_ = std::max(farthest_mm_, distance_mm);
        }
        return other;
      }
    }
    points_mm_.push_back(p_mm);
    at_[cell].push_back(static_cast<int>(points_mm_.size()) - 1);
    return static_cast<int>(points_mm_.size()) - 1;
  }

  const std::vector<Eigen::Vector3d>& points_mm() const { return points_mm_; }

  void report(std::vector<Repair>& repairs) const {
    if (moved_.empty()) return;
    Repair repair = counted(Flaw::kJoinedPoints, static_cast<int>(moved_.size()), first_mm_, "joined");
    repair.length_m = farthest_mm_ / 1e3;
    repairs.push_back(repair);
  }

 private:
  using Cell = std::array<long, 3>;
  struct Hash {
    std::size_t operator()(const Cell& c) const {
      return static_cast<std::size_t>(c[0] * 73856093L ^ c[1] * 19349663L ^ c[2] * 83492791L);
    }
  };

  Cell cellOf(const Eigen::Vector3d& p_mm) const {
    const auto cell = [&](double x_mm) { return std::lround(x_mm / tolerance_mm_); };
    return {cell(p_mm.x()), cell(p_mm.y()), cell(p_mm.z())};
  }

  double tolerance_mm_, farthest_mm_ = 0;
  Eigen::Vector3d first_mm_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> points_mm_;
  std::unordered_map<Cell, std::vector<int>, Hash> at_;
  std::set<std::array<double, 3>> moved_;
};

TriangleMesh joined(const TriangleMesh& surface, double tolerance_mm, std::vector<Repair>& repairs) {
  TriangleMesh mesh;
  JoinedPoints points(tolerance_mm);
  std::vector<int> point_of;
  for (const Eigen::Vector3d& p_mm : surface.points_mm) point_of.push_back(points.add(p_mm));
  mesh.points_mm = points.points_mm();
  points.report(repairs);
  std::set<Triangle> known;
  int twice = 0;
  Eigen::Vector3d first_mm = Eigen::Vector3d::Zero();
  for (Triangle t : surface.triangles) {
    for (int& corner : t) corner = point_of[corner];
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    Triangle sorted = t;
    std::sort(sorted.begin(), sorted.end());
    if (known.insert(sorted).second) {
      mesh.triangles.push_back(t);
    } else if (twice++ == 0) {
      first_mm = mesh.points_mm[t[0]];
    }
  }
  if (twice > 0) repairs.push_back(counted(Flaw::kDoubleTriangle, twice, first_mm, "taken once"));
  return mesh;
}

struct EdgeUse {
  int triangles = 0, forward = 0;  // Forward: from the smaller number to the larger.
};

std::map<Edge, EdgeUse> edgesOf(const TriangleMesh& mesh) {
  std::map<Edge, EdgeUse> edges;
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      EdgeUse& use = edges[edgeOf(t[k], t[(k + 1) % 3])];
      ++use.triangles;
      use.forward += t[k] < t[(k + 1) % 3];
    }
  }
  return edges;
}

std::vector<TriangleMesh> shellsOf(const TriangleMesh& mesh) {
  Groups groups(mesh.triangles.size());
  std::map<Edge, int> first_at;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    for (int k = 0; k < 3; ++k) {
      const auto [place, fresh] = first_at.emplace(edgeOf(t[k], t[(k + 1) % 3]), static_cast<int>(i));
      if (!fresh) groups.join(place->second, static_cast<int>(i));
    }
  }
  std::map<int, std::size_t> shell_of;
  std::vector<TriangleMesh> shells;
  std::vector<std::unordered_map<int, int>> numbers;  // Of each shell's points.
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto [place, fresh] = shell_of.emplace(groups.of(static_cast<int>(i)), shells.size());
    if (fresh) shells.emplace_back(), numbers.emplace_back();
    TriangleMesh& shell = shells[place->second];
    Triangle t = mesh.triangles[i];
    for (int& corner : t) {
      const auto [number, is_new] = numbers[place->second].emplace(corner, static_cast<int>(shell.points_mm.size()));
      if (is_new) shell.points_mm.push_back(mesh.points_mm[corner]);
      corner = number->second;
    }
    shell.triangles.push_back(t);
  }
  return shells;
}

// A connected border of holes.
struct Border {
  std::vector<Edge> edges;  // As lids use them.
  bool open = false;        // Some of its edges have one triangle only.
};

std::vector<Border> bordersOf(const TriangleMesh& shell, const std::map<Edge, EdgeUse>& edges) {
  Groups groups(shell.points_mm.size());
  for (const auto& [edge, use] : edges) {
    if (use.triangles % 2 == 1) groups.join(edge.first, edge.second);
  }
  std::map<int, Border> borders;
  for (const auto& [edge, use] : edges) {
    if (use.triangles % 2 == 0) continue;
    Border& border = borders[groups.of(edge.first)];
    const bool backward = 2 * use.forward > use.triangles;  // The lid's triangle runs the other way.
    border.edges.push_back(backward ? Edge(edge.second, edge.first) : edge);
    border.open = border.open || use.triangles == 1;
  }
  std::vector<Border> result;
  for (auto& entry : borders) result.push_back(std::move(entry.second));
  return result;
}

void addLid(const Border& border, TriangleMesh& shell, std::vector<Repair>& repairs) {
  Eigen::Vector3d sum_mm = Eigen::Vector3d::Zero();
  double length_mm = 0;
  for (const auto& [a, b] : border.edges) {
    const double edge_mm = (shell.points_mm[a] - shell.points_mm[b]).norm();
    sum_mm += edge_mm * (shell.points_mm[a] + shell.points_mm[b]) / 2;
    length_mm += edge_mm;
  }
  const Eigen::Vector3d middle_mm = sum_mm / length_mm;
  shell.points_mm.push_back(middle_mm);
  const int middle = static_cast<int>(shell.points_mm.size()) - 1;
  for (const auto& [a, b] : border.edges) shell.triangles.push_back({a, b, middle});
  repairs.push_back({border.open ? Flaw::kOpenEnd : Flaw::kInnerWall, middle_mm / 1e3, length_mm / 1e3,
                     length_mm / 1e3 / (2 * kPi), 1, border.open ? "closed by a flat lid" : "passed over"});
}

// Six times the volume within, if fronts are outwards; minus that if they are inwards.
double orientedVolume(const TriangleMesh& shell) {
  double sum = 0;
  const Eigen::Vector3d origin = shell.points_mm.front();
  for (const auto& [a, b, c] : shell.triangles) {
    const Eigen::Vector3d u = shell.points_mm[a] - origin, v = shell.points_mm[b] - origin;
    sum += u.cross(v).dot(shell.points_mm[c] - origin);
  }
  return sum;
}

void reportNormals(const TriangleMesh& shell, const std::map<Edge, EdgeUse>& edges, std::vector<Repair>& repairs) {
  constexpr const char* kUnused = "no matter, as normals are not used";
  int mixed = 0;
  Eigen::Vector3d first_mm = Eigen::Vector3d::Zero();
  for (const auto& [edge, use] : edges) {
    if (use.triangles != 2 || use.forward == 1) continue;
    if (mixed++ == 0) first_mm = shell.points_mm[edge.first];
  }
  if (mixed > 0) {
    repairs.push_back(counted(Flaw::kMixedNormals, mixed, first_mm, kUnused));
  } else if (orientedVolume(shell) < 0) {
    repairs.push_back(counted(Flaw::kInwardNormals, 1, shell.points_mm.front(), kUnused));
  }
}

// Of its box.
double diagonal_mm(const TriangleMesh& shell, Eigen::Vector3d* middle_mm = nullptr) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = -low;
  for (const Eigen::Vector3d& p_mm : shell.points_mm) low = low.cwiseMin(p_mm), high = high.cwiseMax(p_mm);
  if (middle_mm) *middle_mm = (low + high) / 2;
  return (high - low).norm();
}

}  // namespace

ClosedShells closedShells(const TriangleMesh& surface, double tolerance_mm) {
  ClosedShells result;
  result.shells = shellsOf(joined(surface, tolerance_mm, result.repairs));
  std::stable_sort(result.shells.begin(), result.shells.end(),
                   [](const auto& a, const auto& b) { return diagonal_mm(a) > diagonal_mm(b); });
  for (TriangleMesh& shell : result.shells) {
    if (result.shells.size() > 1) {
      Eigen::Vector3d middle_mm;
      const double length_mm = diagonal_mm(shell, &middle_mm);
      result.repairs.push_back({Flaw::kShell, middle_mm / 1e3, length_mm / 1e3, 0, 1, "filled by itself"});
    }
    const auto edges = edgesOf(shell);
    for (const Border& border : bordersOf(shell, edges)) addLid(border, shell, result.repairs);
    reportNormals(shell, edges, result.repairs);
  }
  return result;
}

}  // namespace angio::volume

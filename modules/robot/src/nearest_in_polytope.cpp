// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/nearest_in_polytope.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <array>

namespace angio::robot {
namespace {

constexpr int kMaxSteps = 100;

// Faces that the point keeps to, at most one for each dimension.
struct ActiveSet {
  std::array<int, kCArmJointCount> faces{};
  int count = 0;

  bool holds(int face) const {
    for (int i = 0; i < count; ++i) {
      if (faces[static_cast<std::size_t>(i)] == face) return true;
    }
    return false;
  }
  void add(int face) { faces[static_cast<std::size_t>(count++)] = face; }
  void remove(int place) {
    --count;
    for (int i = place; i < count; ++i) faces[static_cast<std::size_t>(i)] = faces[static_cast<std::size_t>(i) + 1];
  }
};

}  // namespace

CArmJoints nearestInPolytope(const CArmJoints& wanted, const Polytope& polytope, const CArmJoints& inside) {
  CArmJoints x = inside;
  ActiveSet active;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Matrix<double, kCArmJointCount, Eigen::Dynamic, 0, kCArmJointCount, kCArmJointCount> A(kCArmJointCount,
                                                                                                  active.count);
    for (int i = 0; i < active.count; ++i) {
      A.col(i) = polytope.normals.row(active.faces[static_cast<std::size_t>(i)]).transpose();
    }
    // The move to `wanted` within the active faces, and the multipliers that hold it there (eq. 16.39), by A = Q R.
    CArmJoints move = wanted - x;
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kCArmJointCount, 1> multipliers(active.count);
    if (active.count > 0) {
      const Eigen::HouseholderQR<decltype(A)> qr(A);
      move.applyOnTheLeft(qr.householderQ().adjoint());
      multipliers =
          qr.matrixQR().topRows(active.count).template triangularView<Eigen::Upper>().solve(move.head(active.count));
      move.head(active.count).setZero();
      move.applyOnTheLeft(qr.householderQ());
    }
    if (move.norm() <= 1e-12 * (1 + wanted.norm())) {
      int released = -1;
      for (int i = 0; i < active.count; ++i) {
        const int face = active.faces[static_cast<std::size_t>(i)];
        if (multipliers[i] < 0 && (released < 0 || face < active.faces[static_cast<std::size_t>(released)])) {
          released = i;
        }
      }
      if (released < 0) return x;
      active.remove(released);
      continue;
    }
    double length = 1;
    int blocking = -1;
    for (int k = 0; k < polytope.size(); ++k) {
      if (active.holds(k)) continue;
      const double speed = polytope.normals.row(k).dot(move);
      if (speed <= 1e-12 * move.norm()) continue;
      const double until = std::max(0.0, polytope.bounds[k] - polytope.normals.row(k).dot(x)) / speed;
      if (until < length) {
        length = until;
        blocking = k;
      }
    }
    x += length * move;
    if (blocking >= 0) active.add(blocking);
  }
  return x;
}

}  // namespace angio::robot

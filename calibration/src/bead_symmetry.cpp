// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_symmetry.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace angio::calibration {
namespace {

using Triple = std::array<int, 3>;

// A right-handed frame on three points, or a left-handed one.
Eigen::Isometry3d frameOn(const BeadPhantom& phantom, const Triple& t) {
  const auto at = [&](int i) {
    return phantom.beads[static_cast<std::size_t>(t[static_cast<std::size_t>(i)])].position_m;
  };
  const Eigen::Vector3d x = (at(1) - at(0)).normalized(), z = x.cross(at(2) - at(0)).normalized();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear() << x, z.cross(x), z;
  frame.translation() = at(0);
  return frame;
}

class SymmetrySearch {
 public:
  SymmetrySearch(const BeadPhantom& phantom, double tolerance_m) : phantom_(phantom), tolerance_m_(tolerance_m) {}

  std::optional<BeadSymmetry> find() const {
    const Triple base = baseTriple();
    const Eigen::Isometry3d from = frameOn(phantom_, base);
    const double d01 = distance(base[0], base[1]), d02 = distance(base[0], base[2]), d12 = distance(base[1], base[2]);
    const int count = static_cast<int>(phantom_.beads.size());
    for (int i = 0; i < count; ++i) {
      if (!sameSize(i, base[0])) continue;
      for (int j = 0; j < count; ++j) {
        if (j == i || !sameSize(j, base[1]) || !near(distance(i, j), d01)) continue;
        for (int k = 0; k < count; ++k) {
          if (k == i || k == j || !sameSize(k, base[2])) continue;
          if (!near(distance(i, k), d02) || !near(distance(j, k), d12)) continue;
          const Eigen::Isometry3d to = frameOn(phantom_, {i, j, k});
          for (const bool mirrors : {false, true}) {
            if (!mirrors && i == base[0] && j == base[1] && k == base[2]) continue;
            Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
            if (mirrors) flip(2, 2) = -1;
            const Eigen::Matrix3d A = to.linear() * flip * from.linear().transpose();
            if (const auto found = movedOnto(A, to.translation() - A * from.translation(), mirrors)) return found;
          }
        }
      }
    }
    return std::nullopt;
  }

 private:
  // Three beads far from each other and from a line, so that their place says where all others are.
  Triple baseTriple() const {
    const int count = static_cast<int>(phantom_.beads.size());
    const auto farthest = [&](const auto& measure) {
      int best = 0;
      for (int i = 1; i < count; ++i) {
        if (measure(i) > measure(best)) best = i;
      }
      return best;
    };
    Triple base{};
    base[0] = farthest([&](int i) { return (position(i) - phantom_.center_m()).norm(); });
    base[1] = farthest([&](int i) { return distance(i, base[0]); });
    const Eigen::Vector3d axis = (position(base[1]) - position(base[0])).normalized();
    base[2] = farthest([&](int i) { return axis.cross(position(i) - position(base[0])).norm(); });
    return base;
  }

  const Eigen::Vector3d& position(int i) const { return phantom_.beads[static_cast<std::size_t>(i)].position_m; }
  double distance(int i, int j) const { return (position(i) - position(j)).norm(); }
  bool near(double a, double b) const { return std::abs(a - b) < 2 * tolerance_m_; }
  bool sameSize(int i, int j) const {
    const double a = phantom_.beads[static_cast<std::size_t>(i)].radius_m;
    const double b = phantom_.beads[static_cast<std::size_t>(j)].radius_m;
    return std::abs(a - b) <= 0.2 * std::max(a, b);  // What an image cannot tell apart for sure.
  }

  // Where the movement puts each bead onto one of its size, and some bead onto another.
  std::optional<BeadSymmetry> movedOnto(const Eigen::Matrix3d& A, const Eigen::Vector3d& t, bool mirrors) const {
    const int count = static_cast<int>(phantom_.beads.size());
    std::optional<BeadSymmetry> moved;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d p = A * position(i) + t;
      int image = -1;
      for (int j = 0; j < count && image < 0; ++j) {
        if ((position(j) - p).squaredNorm() < tolerance_m_ * tolerance_m_ && sameSize(i, j)) image = j;
      }
      if (image < 0) return std::nullopt;
      if (image != i && !moved) moved = BeadSymmetry{i, image, mirrors};
    }
    return moved;
  }

  const BeadPhantom& phantom_;
  double tolerance_m_;
};

}  // namespace

std::optional<BeadSymmetry> symmetryOf(const BeadPhantom& phantom, double tolerance_m) {
  return SymmetrySearch(phantom, tolerance_m).find();
}

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#include "bead_symmetry.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

namespace angio::calibration {
namespace {

using Triple = std::array<int, 3>;

// A right-handed frame on three points, or a left-handed one.
Eigen::Isometry3d frameOn(const BeadPhantom& phantom, const Triple& t) {
  const auto at = [&](int i) { return phantom.beads[t[i]].position_m; };
  const Eigen::Vector3d x = (at(1) - at(0)).normalized(), z = x.cross(at(2) - at(0)).normalized();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear() << x, z.cross(x), z;
  frame.translation() = at(0);
  return frame;
}

// Tries every triple of beads that has the distances of one triple, which says where all others are.
class SymmetrySearch {
 public:
  SymmetrySearch(const BeadPhantom& phantom, double tolerance_m) : phantom_(phantom), tolerance_m_(tolerance_m) {}

  std::vector<PhantomSymmetry> find(std::size_t most) const {
    std::vector<PhantomSymmetry> found(1);
    found.front().image.resize(phantom_.beads.size());
    std::iota(found.front().image.begin(), found.front().image.end(), 0);
    const Triple base = baseTriple();
    const Eigen::Isometry3d from = frameOn(phantom_, base);
    const double d01 = distance(base[0], base[1]), d02 = distance(base[0], base[2]), d12 = distance(base[1], base[2]);
    const int count = static_cast<int>(phantom_.beads.size());
    for (int i = 0; i < count; ++i) {
      if (!sameSize(i, base[0])) continue;
      for (int j = 0; j < count; ++j) {
        if (j == i || !sameSize(j, base[1]) || !near(distance(i, j), d01)) continue;
        for (int k = 0; k < count && found.size() < most; ++k) {
          if (k == i || k == j || !sameSize(k, base[2])) continue;
          if (!near(distance(i, k), d02) || !near(distance(j, k), d12)) continue;
          const Eigen::Isometry3d to = frameOn(phantom_, {i, j, k});
          for (const bool mirrors : {false, true}) {
            if (!mirrors && i == base[0] && j == base[1] && k == base[2]) continue;
            Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
            if (mirrors) flip(2, 2) = -1;
            const Eigen::Matrix3d A = to.linear() * flip * from.linear().transpose();
            if (auto image = movedOnto(A, to.translation() - A * from.translation())) {
              if (*image != found.front().image) found.push_back({mirrors, std::move(*image)});
            }
          }
        }
      }
    }
    return found;
  }

 private:
  // Three beads far from each other and from a line.
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

  const Eigen::Vector3d& position(int i) const { return phantom_.beads[i].position_m; }
  double distance(int i, int j) const { return (position(i) - position(j)).norm(); }
  bool near(double a, double b) const { return std::abs(a - b) < 2 * tolerance_m_; }
  bool sameSize(int i, int j) const {
    const double a = phantom_.beads[i].radius_m;
    const double b = phantom_.beads[j].radius_m;
    return std::abs(a - b) <= 0.2 * std::max(a, b);
  }

  // Which bead each comes to stand on, if every one does on one of its size.
  std::optional<std::vector<int>> movedOnto(const Eigen::Matrix3d& A, const Eigen::Vector3d& t) const {
    const int count = static_cast<int>(phantom_.beads.size());
    std::vector<int> images;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d p = A * position(i) + t;
      int image = -1;
      for (int j = 0; j < count && image < 0; ++j) {
        if ((position(j) - p).squaredNorm() < tolerance_m_ * tolerance_m_ && sameSize(i, j)) image = j;
      }
      if (image < 0) return std::nullopt;
      images.push_back(image);
    }
    return images;
  }

  const BeadPhantom& phantom_;
  double tolerance_m_;
};

}  // namespace

std::vector<PhantomSymmetry> symmetriesOf(const BeadPhantom& phantom, double tolerance_m, std::size_t most) {
  return SymmetrySearch(phantom, tolerance_m).find(most);
}

}  // namespace angio::calibration

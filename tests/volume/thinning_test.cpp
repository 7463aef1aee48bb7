// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/volume/thinning.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "angio/test/random.hpp"
#include "angio/volume/level_field.hpp"

namespace angio::test {
namespace {

VoxelMask maskOf(const Eigen::Vector3i& size, const std::function<bool(const Eigen::Vector3i&)>& inside) {
  VoxelMask mask;
  mask.grid.size = size;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) mask.inside.push_back(inside({x, y, z}) ? 1 : 0);
    }
  }
  return mask;
}

// Components of the voxels that have a value.
int components(const VoxelMask& mask, std::uint8_t value, bool by_corners) {
  std::vector<bool> seen(mask.inside.size(), false);
  int count = 0;
  for (int z = 0; z < mask.grid.size.z(); ++z) {
    for (int y = 0; y < mask.grid.size.y(); ++y) {
      for (int x = 0; x < mask.grid.size.x(); ++x) {
        std::vector<Eigen::Vector3i> open;
        const auto visit = [&](const Eigen::Vector3i& v) {
          if (!mask.grid.holds(v) || seen[mask.grid.offset(v)] || mask.inside[mask.grid.offset(v)] != value) return;
          seen[mask.grid.offset(v)] = true;
          open.push_back(v);
        };
        visit({x, y, z});
        count += open.empty() ? 0 : 1;
        while (!open.empty()) {
          const Eigen::Vector3i v = open.back();
          open.pop_back();
          for (int k = 0; k < 27; ++k) {
            const Eigen::Vector3i step(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            if (by_corners || step.cwiseAbs().sum() == 1) visit(v + step);
          }
        }
      }
    }
  }
  return count;
}

TEST(Thinning, EulerNumberOfKnownShapes) {
  const Eigen::Vector3i size(9, 9, 9), middle(4, 4, 4);
  const auto radius = [&](const Eigen::Vector3i& v) { return (v - middle).cwiseAbs().maxCoeff(); };
  EXPECT_EQ(eulerNumber(maskOf(size, [&](const auto& v) { return radius(v) <= 2; })), 1);
  EXPECT_EQ(eulerNumber(maskOf(size, [&](const auto& v) { return radius(v) == 2; })), 2);  // A cavity.
  EXPECT_EQ(eulerNumber(maskOf(size,
                               [&](const auto& v) {
                                 return radius(v) == 2 && v.z() == 4;  // A ring.
                               })),
            0);
  EXPECT_EQ(eulerNumber(maskOf(size, [&](const auto& v) { return v == middle || v == Eigen::Vector3i(1, 1, 1); })), 2);
}

TEST(Thinning, SimpleVoxelsAreThoseThatLeaveTheTopology) {
  // A voxel is simple just when what it touches of the others is contractible: connected and of Euler number one, which
  // is when taking it away leaves the Euler number (Bertrand and Malandain say the same by counting components).
  test::Random random(3);
  int simple = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const double density = random.uniform(0.05, 0.95);
    Neighbourhood bits = 1U << 13;
    VoxelMask with = maskOf({3, 3, 3}, [](const auto&) { return false; });
    for (std::size_t k = 0; k < 27; ++k) {
      if (k != 13 && random.uniform(0, 1) < density) bits |= 1U << k;
      with.inside[k] = bits >> k & 1;
    }
    VoxelMask without = with;
    without.inside[13] = 0;
    const bool expected = components(without, 1, true) == 1 && eulerNumber(with) == eulerNumber(without);
    EXPECT_EQ(isSimple(bits), expected) << bits;
    simple += expected;
  }
  EXPECT_GT(simple, 400);
}

TEST(Thinning, TopologyOfRandomBlobsStays) {
  test::Random random(11);
  for (int trial = 0; trial < 6; ++trial) {
    // Balls and holes at random: pieces, tunnels and cavities.
    std::vector<Eigen::Vector4d> balls;
    for (int i = 0; i < 40; ++i) {
      balls.emplace_back(random.uniform(0, 30), random.uniform(0, 30), random.uniform(0, 30), random.uniform(1.5, 5));
    }
    const VoxelMask mask = maskOf({30, 30, 30}, [&](const Eigen::Vector3i& v) {
      bool inside = false;
      for (std::size_t i = 0; i < balls.size(); ++i) {
        if ((balls[i].head<3>() - v.cast<double>()).norm() < balls[i].w()) inside = i % 3 != 2;
      }
      return inside;
    });
    const VoxelMask skeleton = thinned(mask, distanceMap(mask, 0));
    EXPECT_EQ(eulerNumber(skeleton), eulerNumber(mask));
    EXPECT_EQ(components(skeleton, 1, true), components(mask, 1, true));
    EXPECT_LT(std::count(skeleton.inside.begin(), skeleton.inside.end(), 1),
              std::count(mask.inside.begin(), mask.inside.end(), 1) / 2);
  }
}

TEST(Thinning, CylinderBecomesItsAxis) {
  const VoxelMask mask = maskOf({15, 15, 40}, [](const Eigen::Vector3i& v) {
    return (v.head<2>() - Eigen::Vector2i(7, 7)).squaredNorm() <= 25 && v.z() >= 3 && v.z() < 37;
  });
  const VoxelMask skeleton = thinned(mask, distanceMap(mask, 0));
  for (int z = 10; z < 30; ++z) {  // The ends run out into corners.
    int count = 0;
    for (int at = 0; at < 225; ++at) count += skeleton.inside[static_cast<std::size_t>(225 * z + at)];
    EXPECT_EQ(count, 1) << z;
    EXPECT_EQ(skeleton.inside[mask.grid.offset({7, 7, z})], 1) << z;
  }
}

}  // namespace
}  // namespace angio::test

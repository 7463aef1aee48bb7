// SPDX-License-Identifier: GPL-2.0-or-later
#include "three_point_pose.hpp"

#include <gtest/gtest.h>

#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Three points of a phantom of 150 mm, about a metre from the source.
struct SeenPoints {
  Eigen::Matrix3d points_m, rays;
  Pose truth = Pose::Identity();

  explicit SeenPoints(test::Random& random) {
    for (int k = 0; k < 3; ++k) points_m.col(k) = random.vector(0.05);
    truth.linear() = expSO3(random.uniform(0, 3) * random.direction());
    truth.translation() << random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(0.8, 1.4);
    for (int k = 0; k < 3; ++k) rays.col(k) = (truth * points_m.col(k)).normalized();
  }
};

TEST(ThreePointPoses, AreSeenAlongTheirRaysAndHoldTheTruth) {
  test::Random random(4);
  std::vector<Pose> poses;
  int held = 0;
  constexpr int kDraws = 500;
  for (int draw = 0; draw < kDraws; ++draw) {
    const SeenPoints s(random);
    calibration::threePointPoses(s.points_m, s.rays, poses);
    double nearest = 1;
    for (const Pose& pose : poses) {
      EXPECT_LT(rotationDefect(pose.linear()), 1e-9);
      // Halving 44 times a step of the ratio leaves 2e-15 of the distance; what stands nearly in a line loses most of
      // it.
      for (int k = 0; k < 3; ++k)
        EXPECT_LT(((pose * s.points_m.col(k)).normalized() - s.rays.col(k)).norm(), 1e-6) << draw;
      nearest = std::min(nearest, (pose.matrix() - s.truth.matrix()).cwiseAbs().maxCoeff());
    }
    held += nearest < 1e-4 ? 1 : 0;
  }
  // Two poses that nearly meet lie between two of the places that are looked at: a search has other triples.
  EXPECT_GE(held, 0.95 * kDraws);
}

}  // namespace
}  // namespace angio::test

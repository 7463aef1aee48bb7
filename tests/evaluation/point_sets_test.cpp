// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/point_sets.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

constexpr Kernel kLosses3d[] = {Kernel::kGaussian, Kernel::kHuber, Kernel::kL2};

double meanOff(const Eigen::Matrix3Xd& points, const Pose& a, const Pose& b) {
  return ((a * points) - (b * points)).colwise().norm().mean();
}

TEST(PointSets, ANearCopyIsFoundExactlyWithEveryLoss) {
  const VesselTree tree = test::branchingTree(4);
  test::Random random(5);
  Twist off;
  off << 0.2e-3 * random.direction(), degToRad(0.1) * random.direction();  // Less than the points' distance.
  const Pose truth = expSE3(off);
  for (const Kernel loss : kLosses3d) {
    const Pose found = alignedPointSets(tree.points(), truth * tree.points(), Pose::Identity(), loss, 1e-3);
    EXPECT_LT(meanOff(tree.points(), found, truth), 1e-9) << static_cast<int>(loss);
  }
}

// Both sides moved: the same answer, moved.
TEST(PointSets, MovesWithTheFrame) {
  const VesselTree tree = test::branchingTree(6);
  test::Random random(7);
  Twist off;
  off << 4e-3 * random.direction(), degToRad(3) * random.direction();
  const Eigen::Matrix3Xd target = (expSE3(off) * tree.points()).leftCols(tree.size() / 2);
  const Pose G = expSE3(random.twist(0.1, 1));
  for (const Kernel loss : kLosses3d) {
    const Pose a = alignedPointSets(tree.points(), target, Pose::Identity(), loss, 1e-3);
    const Pose b = alignedPointSets(G * tree.points(), G * target, Pose::Identity(), loss, 1e-3);
    EXPECT_LT(meanOff(tree.points(), G * a, b * G), 1e-6) << static_cast<int>(loss);
  }
}

TEST(PointSets, AStudyCountsEveryLossInEveryWorld) {
  const Json study = pointSetStudy(test::branchingTree(1), 2, 3);
  ASSERT_EQ(study.size(), 12u);
  EXPECT_EQ(pointSetStudySize(2), 72);
  for (const Json& row : study) {
    for (const char* loss : {"kernel", "Huber", "squares"}) {
      const double percent = row["losses"][loss]["success_percent"];
      EXPECT_TRUE(percent == 0 || percent == 50 || percent == 100);
    }
  }
  EXPECT_NE(pointSetTable(study).find("| half of the points | 10 deg, 20 mm |"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

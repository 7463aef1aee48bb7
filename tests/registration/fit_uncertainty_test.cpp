// SPDX-License-Identifier: GPL-2.0-or-later
#include "fit_uncertainty.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

using registration::Claims;
using registration::claimsOfDeformed;

// A pose known to a millimetre and a hundredth of a radian, and every point to two millimetres.
class KnownError final : public registration::TreeError {
 public:
  KnownError() {
    twist_.diagonal() << Eigen::Vector3d::Constant(1e-6), Eigen::Vector3d::Constant(1e-4);
    noise_ = 0.25 * twist_;
  }
  Eigen::Matrix3d pointCovariance(const Eigen::Vector3d&) const override { return 4e-6 * Eigen::Matrix3d::Identity(); }
};

// All that is claimed is a standard deviation times the factor.
TEST(FitUncertainty, ClaimsWidenAllOfIt) {
  const VesselTree tree = test::branchingTree(3);
  test::Random random(7);
  const Eigen::Matrix3Xd centered = tree.points().colwise() - tree.centroid();
  RegistrationResult plain, widened;
  plain.T_camera_model = widened.T_camera_model = test::viewOf(tree, random);
  const Pose T_camera_centered = plain.T_camera_model * Eigen::Translation3d(tree.centroid());
  const auto error = std::make_shared<KnownError>();
  setUncertainty(error, centered, T_camera_centered, tree.centroid(), plain);
  setUncertainty(error, centered, T_camera_centered, tree.centroid(), widened, Claims{3, nullptr});
  EXPECT_TRUE(widened.covariance->isApprox(9 * *plain.covariance, 1e-12));
  EXPECT_TRUE(widened.noise_covariance->isApprox(9 * *plain.noise_covariance, 1e-12));
  const Eigen::Vector3d point = tree.points().col(0);
  EXPECT_TRUE(widened.points->covarianceAt(point).isApprox(9 * plain.points->covarianceAt(point), 1e-12));
  EXPECT_NEAR(widened.spread->noise_m, 3 * plain.spread->noise_m, 1e-12);
  EXPECT_NEAR(widened.spread->all_m, 3 * plain.spread->all_m, 1e-12);
  EXPECT_NEAR(widened.spread->across_m, 3 * plain.spread->across_m, 1e-12);
}

// A sixteenth of the variance is no tail.
class TailedError final : public registration::TreeError {
 public:
  Eigen::Matrix3d pointCovariance(const Eigen::Vector3d&) const override { return 64e-6 * Eigen::Matrix3d::Identity(); }
  std::shared_ptr<const TreeError> central() const override { return std::make_shared<KnownError>(); }
};

// A normal error's intervals are those of its covariance. Others are narrower by their tails, and by their own factor.
TEST(FitUncertainty, IntervalsLeaveTailsOut) {
  const VesselTree tree = test::branchingTree(3);
  test::Random random(7);
  const Eigen::Matrix3Xd centered = tree.points().colwise() - tree.centroid();
  RegistrationResult result;
  result.T_camera_model = test::viewOf(tree, random);
  const Pose T_camera_centered = result.T_camera_model * Eigen::Translation3d(tree.centroid());
  const Eigen::Vector3d point = tree.points().col(0);
  const auto intervalsWith = [&](const Claims& claims) {
    setUncertainty(std::make_shared<TailedError>(), centered, T_camera_centered, tree.centroid(), result, claims);
    return result.points->centralCovarianceAt(point);
  };
  const Eigen::Matrix3d normal_m2 = intervalsWith({3, nullptr});
  EXPECT_EQ(normal_m2, result.points->covarianceAt(point));
  const Eigen::Matrix3d expected_m2 = 0.25 * 9 * 4e-6 * Eigen::Matrix3d::Identity();
  EXPECT_TRUE(intervalsWith({3, nullptr, 1, Claims::Central{0.5, 1}}).isApprox(expected_m2, 1e-12));
  EXPECT_TRUE(result.points->covarianceAt(point).isApprox(9 * 64e-6 * Eigen::Matrix3d::Identity(), 1e-12));
}

// The factors that brains deformed by 5 mm needed in two views: 1.25 at a score of 0.54, 2.2 below 0.5. One view is
// wider by its process already.
TEST(FitUncertainty, LessIsClaimedWhereLessIsExplained) {
  for (const std::size_t views : {std::size_t{1}, std::size_t{2}}) {
    const auto factor = [&](double score) {
      AlignmentScore alignment;
      alignment.model_explained = score;
      alignment.image_explained = 1;
      return claimsOfDeformed(alignment, views, nullptr).factor;
    };
    EXPECT_DOUBLE_EQ(factor(0.9), factor(0.65));
    EXPECT_LT(factor(0.65), factor(0.42));
    if (views == 1) continue;
    EXPECT_GT(factor(0.54), 1.25);
    EXPECT_GT(factor(0.455), 2.2);
  }
}

}  // namespace
}  // namespace angio::test

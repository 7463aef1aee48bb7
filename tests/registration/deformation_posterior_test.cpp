// SPDX-License-Identifier: GPL-2.0-or-later
#include "deformation_posterior.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using registration::DeformationPosterior;
using registration::DeformationProcess;
using registration::ErrorSizes;
using registration::PosePriorTerm;
using registration::ResidualArrays;
using registration::ResidualGroup;

constexpr double kFieldLength_m = 60e-3, kPosteriorFocal_px = 3880, kPosteriorDepth_m = 0.8, kPosteriorNoise_px = 1;
constexpr double kTurnStd_rad = 0.035, kShiftStd_m = 5e-3;
constexpr int kGroups = 60, kPosteriorPoints = 60;  // Points of a group.

// Residuals of a tree 100 mm wide whose pose and deformation are drawn from what the posterior takes them to be drawn
// from, and one place more, of which only the truth is known.
struct DrawnPosterior {
  std::vector<ResidualGroup> groups;
  PosePriorTerm belief;
  Eigen::Vector3d at = Eigen::Vector3d::Zero(), moved_m = Eigen::Vector3d::Zero();
};

// Every other group is seen along x where there are two views, else all along z.
DrawnPosterior drawPosterior(test::Random& random, double deformation_m, const ProcessShape& shape = kOneViewShape,
                             int views = 1) {
  DrawnPosterior drawn;
  drawn.belief.information.diagonal() << Eigen::Vector3d::Constant(1 / (kShiftStd_m * kShiftStd_m)),
      Eigen::Vector3d::Constant(1 / (kTurnStd_rad * kTurnStd_rad));
  Twist twist;
  for (int k = 0; k < 6; ++k) twist[k] = (k < 3 ? kShiftStd_m : kTurnStd_rad) * random.normal();
  for (int i = 0; i < kGroups; ++i) {
    ResidualGroup group;
    group.at = 0.05 * random.vector(1).cwiseMax(-1).cwiseMin(1);
    const double angle = random.uniform(0, kPi), z = kPosteriorDepth_m + group.at.z();
    // Across the vessel, seen along z by a camera with perspective.
    group.gradient = kPosteriorFocal_px / z * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    group.gradient.z() = -group.gradient.head<2>().dot(group.at.head<2>()) / z;
    if (views == 2 && i % 2 == 1) {
      std::swap(group.at.x(), group.at.z());
      std::swap(group.gradient.x(), group.gradient.z());
    }
    group.jacobian << group.gradient, group.at.cross(group.gradient);
    group.weight = group.pull = kPosteriorPoints;
    group.scatter_px2 = kPosteriorNoise_px * kPosteriorNoise_px;
    drawn.groups.push_back(group);
  }
  drawn.at = 0.05 * random.vector(1).cwiseMax(-1).cwiseMin(1);

  // The field at all groups and the place.
  const DeformationProcess process(drawn.groups, kFieldLength_m, shape);
  Eigen::Matrix3Xd places(3, kGroups + 1);
  for (int i = 0; i < kGroups; ++i) places.col(i) = drawn.groups[static_cast<std::size_t>(i)].at;
  places.col(kGroups) = drawn.at;
  const Eigen::MatrixXd alike = process.alike(places, places);
  const Eigen::Index n = places.cols();
  Eigen::MatrixXd covariance(3 * n, 3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      covariance.block<3, 3>(3 * i, 3 * j) =
          alike(i, j) * Eigen::Matrix3d::Identity() + process.growth() * places.col(i) * places.col(j).transpose();
    }
  }
  covariance.diagonal().array() += 1e-9;
  Eigen::VectorXd white(3 * n);
  for (Eigen::Index i = 0; i < 3 * n; ++i) white[i] = random.normal();
  const Eigen::MatrixXd root = lowerFactorOf(covariance);
  const Eigen::VectorXd field = deformation_m * root * white;

  for (int i = 0; i < kGroups; ++i) {
    ResidualGroup& group = drawn.groups[static_cast<std::size_t>(i)];
    group.residual_px = -group.gradient.dot(field.segment<3>(3 * i)) - group.jacobian.dot(twist) +
                        kPosteriorNoise_px / std::sqrt(static_cast<double>(kPosteriorPoints)) * random.normal();
  }
  drawn.moved_m = field.tail<3>() + twist.head<3>() + twist.tail<3>().cross(drawn.at);
  return drawn;
}

Eigen::Vector3d meanAt(const DeformationPosterior& posterior, const Eigen::Vector3d& at) {
  return posterior.displacements(at) + posterior.twist().head<3>() + posterior.twist().tail<3>().cross(at);
}

// Simulation-based calibration (Talts et al. 2018): where the truth is drawn from the prior, its rank in the posterior
// is even, in one view and in two. Chi-square of 9 degrees of freedom: below 27.9 in all but one of a thousand, here of
// 300 ranks each; the amplitude is one of the grid's, and is not told.
class RanksOfTheTruth : public testing::TestWithParam<int> {};

TEST_P(RanksOfTheTruth, AreEven) {
  test::Random random(41);
  constexpr int kTrials = 300, kBins = 10;
  const int views = GetParam();
  ProcessShape shape = views == 1 ? kOneViewShape : kViewsShape;
  shape.tails = 1;  // What is drawn is drawn from the process.
  std::array<std::array<int, kBins>, 3> ranks{};
  constexpr std::array<double, 4> kAmplitudes_m = {0.2e-3, 0.4e-3, 0.8e-3, 1.6e-3};
  for (int trial = 0; trial < kTrials; ++trial) {
    const DrawnPosterior drawn =
        drawPosterior(random, kAmplitudes_m[static_cast<std::size_t>(trial) % kAmplitudes_m.size()], shape, views);
    const DeformationPosterior posterior(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, shape);
    ASSERT_TRUE(posterior.known());
    const Eigen::Vector3d error = meanAt(posterior, drawn.at) - drawn.moved_m;
    const Eigen::Matrix3d C = posterior.pointCovariance(drawn.at);
    for (int axis = 0; axis < 3; ++axis) {
      const double rank = 0.5 * std::erfc(-error[axis] / std::sqrt(2 * C(axis, axis)));
      ++ranks[static_cast<std::size_t>(axis)]
             [static_cast<std::size_t>(std::min(kBins - 1.0, std::floor(kBins * rank)))];
    }
  }
  for (const auto& bins : ranks) {
    constexpr double kEven = static_cast<double>(kTrials) / kBins;
    double chi2 = 0;
    for (const int count : bins) chi2 += (count - kEven) * (count - kEven) / kEven;
    EXPECT_LT(chi2, 27.9);
  }
}

INSTANTIATE_TEST_SUITE_P(Views, RanksOfTheTruth, testing::Values(1, 2));

// Without a deformation nothing but the pose is left, and it is the weighed least squares of residuals and belief.
TEST(DeformationPosterior, OfARigidTreeIsTheRigidFit) {
  test::Random random(43);
  const DrawnPosterior drawn = drawPosterior(random, 0);
  const DeformationPosterior posterior(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, kOneViewShape);
  ASSERT_TRUE(posterior.known());
  Matrix6d H = drawn.belief.information;
  Vector6d g = Vector6d::Zero();
  for (const ResidualGroup& group : drawn.groups) {
    H += kPosteriorPoints * group.jacobian * group.jacobian.transpose();
    g += kPosteriorPoints * group.residual_px * group.jacobian;
  }
  const Twist fit = -solveSymmetric(H, g);
  const Eigen::Vector3d expected = fit.head<3>() + fit.tail<3>().cross(drawn.at);
  // In the image to a tenth of a pixel; in depth the fit is known to 1.5 mm (kPosteriorNoise_px, 3,600 points, a tree
  // of 50 mm).
  EXPECT_LT((meanAt(posterior, drawn.at) - expected).head<2>().norm(), 0.02e-3);
  EXPECT_NEAR(meanAt(posterior, drawn.at).z(), expected.z(), 1.5e-3);
  EXPECT_LT(posterior.amplitude_m(), 0.1e-3);
  EXPECT_LT((meanAt(posterior, drawn.at) - drawn.moved_m).head<2>().norm(), 0.1e-3);
}

// Growth and distance look alike: what a single view says of depth is what was believed, and no more is claimed.
TEST(DeformationPosterior, ADeformedTreeKeepsTheDepthOfThePrior) {
  test::Random random(47);
  for (int trial = 0; trial < 10; ++trial) {
    const DrawnPosterior drawn = drawPosterior(random, 3e-3);
    const DeformationPosterior posterior(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, kOneViewShape);
    ASSERT_TRUE(posterior.known());
    EXPECT_GT(std::sqrt(posterior.twistCovariance()(2, 2)), 0.8 * kShiftStd_m);
    EXPECT_LT(std::abs(posterior.twist()[2]), kShiftStd_m);
    // The noise alone would leave a tenth of that.
    EXPECT_LT(std::sqrt(posterior.noiseCovariance()(2, 2)), 0.3 * kShiftStd_m);
  }
}

// Of many places at once as of each.
TEST(DeformationProcess, OfWeightsIsTheWeightedSum) {
  test::Random random(54);
  const DrawnPosterior drawn = drawPosterior(random, 1e-3);
  const DeformationProcess process(drawn.groups, kFieldLength_m, kViewsShape);
  const ResidualArrays groups(drawn.groups);
  const Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(groups.at.cols(), -1, 2);
  const Eigen::Matrix3Xd at = 0.05 * Eigen::Matrix3Xd::Random(3, 21);
  const Eigen::Matrix3Xd result = process.ofWeights(groups, weights, at);
  const Eigen::Matrix3Xd local = registration::localOfWeights(groups, weights, at);
  for (Eigen::Index i = 0; i < at.cols(); ++i) {
    EXPECT_TRUE(result.col(i).isApprox(process.withPlace(groups, at.col(i)).transpose() * weights, 1e-9));
    const Eigen::VectorXd factor = registration::localCorrelation(groups.at, at.col(i));
    EXPECT_TRUE(local.col(i).isApprox(groups.gradient * factor.cwiseProduct(weights), 1e-9));
  }
}

// The law does not depend on the axes of the model.
TEST(DeformationPosterior, TurnsWithTheModel) {
  test::Random random(53);
  const DrawnPosterior drawn = drawPosterior(random, 1e-3);
  const Eigen::Matrix3d R = expSO3(Eigen::Vector3d(0.4, -0.7, 0.2));
  DrawnPosterior turned = drawn;
  for (ResidualGroup& group : turned.groups) {
    group.at = R * group.at;
    group.gradient = R * group.gradient;
    group.jacobian << group.gradient, group.at.cross(group.gradient);
  }
  const DeformationPosterior a(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, kOneViewShape);
  const DeformationPosterior b(turned.groups, drawn.belief, Pose::Identity(), kFieldLength_m, kOneViewShape);
  const Eigen::Vector3d at = R * drawn.at;
  // Distances are in single precision, and a turn changes them.
  EXPECT_LT((R * meanAt(a, drawn.at) - meanAt(b, at)).norm(), 1e-8);
  EXPECT_TRUE((R * a.pointCovariance(drawn.at) * R.transpose()).isApprox(b.pointCovariance(at), 1e-6));
}

// Several moments of a patient who does not move are one, and a motion that is anything leaves each to itself.
TEST(DeformationPosterior, OfStillMomentsIsThatOfOne) {
  test::Random random(3);
  const DrawnPosterior drawn = drawPosterior(random, 2e-3);
  const ErrorSizes sizes =
      registration::errorSizes(DeformationProcess(drawn.groups, kFieldLength_m, kOneViewShape), drawn.groups);
  registration::Moments moments;
  for (int i = 0; i < kGroups; ++i) moments.of_group.push_back(i % 3);
  moments.deformation = Eigen::MatrixXd::Ones(3, 3);
  moments.shift_m2 = Eigen::MatrixXd::Zero(3, 3);
  const DeformationPosterior one(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, kOneViewShape);
  const DeformationPosterior still(drawn.groups, moments, sizes, drawn.belief, Pose::Identity(), kFieldLength_m,
                                   kOneViewShape);
  ASSERT_TRUE(one.known() && still.known());
  EXPECT_NEAR((one.twist() - still.twist()).norm(), 0, 1e-9);
  EXPECT_NEAR((one.displacements(drawn.at) - still.displacements(drawn.at)).norm(), 0, 1e-9);
  EXPECT_NEAR((one.pointCovariance(drawn.at) - still.pointCovariance(drawn.at)).norm(), 0, 1e-12);

  // Of a moment without a frame of its own nothing is known but what the others share with it.
  moments.deformation = Eigen::MatrixXd::Identity(3, 3);
  moments.shift_m2 = 25e-6 * Eigen::MatrixXd::Identity(3, 3);
  for (Eigen::Index& moment : moments.of_group) moment = std::min<Eigen::Index>(moment, 1);
  const DeformationPosterior apart(drawn.groups, moments, sizes, drawn.belief, Pose::Identity(), kFieldLength_m,
                                   kOneViewShape);
  ASSERT_TRUE(apart.known());
  EXPECT_NEAR(apart.displacements(drawn.at).norm(), 0, 1e-6)
      << "but for errors over millimetres, which all moments share";
  EXPECT_GT(apart.pointCovariance(drawn.at).trace(), 3 * 25e-6);
}

// Its centre is the posterior of a process that has the amplitude which the residuals speak for, and no more.
TEST(DeformationPosterior, WithoutItsTailsIsThatOfAProcessThatHasNone) {
  test::Random random(47);
  const DrawnPosterior drawn = drawPosterior(random, 1e-3);
  ProcessShape without = kOneViewShape;
  without.tails = 1;
  const DeformationPosterior wide(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, kOneViewShape);
  const DeformationPosterior expected(drawn.groups, drawn.belief, Pose::Identity(), kFieldLength_m, without);
  ASSERT_TRUE(wide.known() && expected.known());
  const auto central = wide.central();
  ASSERT_TRUE(central);
  EXPECT_NEAR(central->amplitude_m(), expected.amplitude_m(), 1e-12);
  EXPECT_TRUE(central->twistCovariance().isApprox(expected.twistCovariance(), 1e-9));
  EXPECT_TRUE(central->pointCovariance(drawn.at).isApprox(expected.pointCovariance(drawn.at), 1e-9));
  EXPECT_LT(central->pointCovariance(drawn.at).trace(), wide.pointCovariance(drawn.at).trace());
  EXPECT_FALSE(expected.central()) << "it has no tails";
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "fit_classification.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "angio/registration/result.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

Pose viewed(const VesselTree& tree) {
  test::Random random(7);
  return test::viewOf(tree, random);
}

Matrix6d diagonal(double translation_std_m, double rotation_std_rad) {
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(translation_std_m * translation_std_m),
      Eigen::Vector3d::Constant(rotation_std_rad * rotation_std_rad);
  return variances.asDiagonal();
}

// Of a pose that the image holds, and a model that it explains.
RegistrationResult wellKnown(const VesselTree& tree) {
  RegistrationResult result;
  result.T_camera_model = viewed(tree);
  result.covariance = diagonal(0.2e-3, 1e-9);
  result.alignment.model_points = 100;
  result.alignment.model_explained = 0.9;
  return result;
}

// Poses drawn from the covariance move the points by as much. The mean of 20,000 squares of some six degrees of freedom
// scatters by less than 1 %.
TEST(FitClassification, SpreadIsHowFarDrawnPosesMoveTheTree) {
  const VesselTree tree = test::branchingTree(3);
  const Pose T = viewed(tree);
  Matrix6d covariance = diagonal(2e-3, 4e-3);
  covariance.topRightCorner<3, 3>().setConstant(1e-6);
  covariance.bottomLeftCorner<3, 3>() = covariance.topRightCorner<3, 3>().transpose();
  const Matrix6d L = lowerFactorOf(covariance);
  test::Random random(11);
  const Eigen::Matrix3Xd turned = T.linear() * tree.points();
  double sum = 0;
  constexpr int kDraws = 20000;
  for (int k = 0; k < kDraws; ++k) {
    Vector6d z;
    for (int i = 0; i < 6; ++i) z[i] = random.normal();
    const Vector6d d = L * z;
    const Eigen::Matrix3Xd moved = (skew(d.tail<3>()) * turned).colwise() + d.head<3>();
    sum += moved.colwise().squaredNorm().mean();
  }
  EXPECT_NEAR(spread_m(covariance, T, tree) / std::sqrt(sum / kDraws), 1, 0.02);
}

// The same alignment score, with a pose that the image determines well or not.
TEST(FitClassification, WhatTheImageLeavesOpenIsNotTrusted) {
  const VesselTree tree = test::branchingTree(3);
  RegistrationResult result;
  result.T_camera_model = viewed(tree);
  result.alignment.model_explained = result.alignment.image_explained = 0.9;
  result.alignment.model_points = 100;
  const auto classified = [&](double translation_std_m) {
    // Translation about the centroid, whatever the tree's place: no rotation but what keeps the matrix regular.
    result.covariance = diagonal(translation_std_m, 1e-9);
    classify(tree, result);
    return result.status;
  };
  EXPECT_EQ(classified(0.2e-3), RegistrationStatus::kConverged);
  EXPECT_EQ(classified(3e-3), RegistrationStatus::kAmbiguous);
  EXPECT_NE(result.reason.find("3 mm"), std::string::npos) << result.reason;

  // Half explained without an alternative: believed when it is held three times as well.
  result.alignment.model_explained = result.alignment.image_explained = 0.5;
  result.covariance = diagonal(0.2e-3, 1e-9);
  classifyAgainst(0.1, tree, result);
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  result.covariance = diagonal(0.8e-3, 1e-9);
  classifyAgainst(0.1, tree, result);
  EXPECT_EQ(result.status, RegistrationStatus::kAmbiguous);
}

// A deformed tree whose points are not known one by one passes the gates of a rigid one.
TEST(FitClassification, ADeformedTreeIsNotTrustedWhereTheImageLeavesItOpen) {
  const VesselTree tree = test::branchingTree(3);
  RegistrationResult result;
  result.T_camera_model = viewed(tree);
  result.alignment.model_explained = result.alignment.image_explained = 0.9;
  result.alignment.model_points = 100;
  result.displacements_m = Eigen::Matrix3Xd::Constant(3, tree.size(), 2e-3);
  const auto classified = [&](double depth_std_m, double alternative) {
    result.covariance = diagonal(0.2e-3, 1e-9);
    (*result.covariance)(2, 2) = depth_std_m * depth_std_m;
    classifyAgainst(alternative, tree, result);
    return result.status;
  };
  EXPECT_EQ(classified(1e-3, 0.6), RegistrationStatus::kConverged);
  EXPECT_EQ(classified(8e-3, 0.6), RegistrationStatus::kAmbiguous);
  EXPECT_NE(result.reason.find("3 mm"), std::string::npos) << result.reason;
  EXPECT_TRUE(explained(result));

  // Half explained, without an alternative: a deformed tree follows any line near by, and is not believed for that; a
  // rigid one is.
  result.alignment.model_explained = result.alignment.image_explained = 0.5;
  EXPECT_EQ(classified(0.5e-3, 0.1), RegistrationStatus::kAmbiguous);
  EXPECT_FALSE(explained(result));
  result.displacements_m.setZero();
  EXPECT_EQ(classified(0.5e-3, 0.1), RegistrationStatus::kConverged);
}

TEST(FitClassification, ALowScoreSufficesOnlyWhereTheResultSaysSo) {
  const VesselTree tree = test::branchingTree(3);
  RegistrationResult result;
  result.T_camera_model = viewed(tree);
  result.covariance = diagonal(0.2e-3, 1e-9);
  result.displacements_m = Eigen::Matrix3Xd::Constant(3, tree.size(), 1e-3);
  result.alignment.model_points = 100;
  const auto classified = [&](double model_explained, double image_explained) {
    result.alignment.model_explained = model_explained;
    result.alignment.image_explained = image_explained;
    classify(tree, result);
    EXPECT_EQ(explained(result), result.status == RegistrationStatus::kConverged);
    return result.status;
  };
  EXPECT_EQ(classified(0.7, 0.65), RegistrationStatus::kAmbiguous);
  result.low_score_suffices = true;
  EXPECT_EQ(classified(0.7, 0.65), RegistrationStatus::kConverged);
  EXPECT_EQ(classified(0.65, 0.62), RegistrationStatus::kAmbiguous) << "a score of 0.40";
  EXPECT_EQ(classified(0.9, 0.55), RegistrationStatus::kAmbiguous) << "too little of the image";
}

TEST(FitClassification, ALargeDeformationHasToExplainTheImage) {
  const VesselTree tree = test::branchingTree(3);
  RegistrationResult result = wellKnown(tree);
  const auto classified = [&](double deformation_m, double image_explained) {
    result.displacements_m = Eigen::Matrix3Xd::Constant(3, tree.size(), deformation_m / std::sqrt(3.));
    result.alignment.image_explained = image_explained;
    classify(tree, result);
    EXPECT_EQ(explained(result), result.status == RegistrationStatus::kConverged);
    return result.status;
  };
  EXPECT_EQ(classified(9e-3, 0.7), RegistrationStatus::kConverged);
  EXPECT_EQ(classified(25e-3, 0.85), RegistrationStatus::kConverged);
  EXPECT_EQ(classified(25e-3, 0.7), RegistrationStatus::kAmbiguous);
  EXPECT_NE(result.reason.find("25 mm"), std::string::npos) << result.reason;
  EXPECT_NE(result.reason.find("70 % of the image"), std::string::npos) << result.reason;
}

TEST(FitClassification, AShiftOfTheWholeIsNoDeformationOfATreeInMotion) {
  const VesselTree tree = test::branchingTree(3);
  RegistrationResult result = wellKnown(tree);
  result.alignment.image_explained = 0.7;
  const auto classified = [&](double shift_m, double stretch_m) {
    result.displacements_m = Eigen::Matrix3Xd::Constant(3, tree.size(), shift_m);
    for (int i = 0; i < tree.size(); ++i) result.displacements_m(0, i) += i % 2 == 0 ? stretch_m : -stretch_m;
    classifyInMotion(tree, result);
    return result.status;
  };
  EXPECT_EQ(classified(15e-3, 5e-3), RegistrationStatus::kConverged);
  classify(tree, result);
  EXPECT_EQ(result.status, RegistrationStatus::kAmbiguous) << "by a classification that knows of no motion";
  EXPECT_EQ(classified(0, 12e-3), RegistrationStatus::kAmbiguous);
  EXPECT_NE(result.reason.find("12 mm"), std::string::npos) << result.reason;
}

}  // namespace
}  // namespace angio::test

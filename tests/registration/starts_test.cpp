// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/starts.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "mean_distance.hpp"

namespace angio::test {
namespace {

struct StartScene {
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  Pose truth;
  PosePrior prior;  // Off by 12 degrees and 12 mm.
  Centerline2d image;
  IterativePnpSettings settings;

  explicit StartScene(unsigned seed) : tree(test::branchingTree(seed)) {
    test::Random random(seed + 200);
    truth = test::viewOf(tree, random);
    Twist off;
    off << 12e-3 * random.direction(), degToRad(12) * random.direction();
    prior.T_camera_model = test::perturbed(truth, tree, off);
    image = projectedCenterline(tree, camera, truth);
    settings.prior = PriorForm::kCovariance;
    settings.prior_rotation_std_deg = 20;
    settings.prior_translation_std_mm = 50;
  }
};

TEST(Search, FindsThePoseWhereTheFirstStartFails) {
  int rescued = 0;
  for (unsigned seed = 0; seed < 12 && rescued == 0; ++seed) {  // About one start in five fails.
    StartScene s(seed);
    const auto registration = makeRegistration(s.settings, s.tree);
    const auto one = registration->align(s.image, s.camera, s.prior);
    if (meanDistance(s.tree, one.T_camera_model, s.truth) < 10e-3) continue;
    ++rescued;
    EXPECT_NE(one.status, RegistrationStatus::kConverged);
    StartSettings starts;
    starts.count = 12;
    starts.rotation_std_deg = 8;
    starts.translation_std_mm = 8;
    const auto many = registration->search(s.image, s.camera, s.prior, starts);
    // A clean image, a weak prior: what is left is depth, where half a millimetre moves no point by a tenth of a pixel.
    EXPECT_LT(meanDistance(s.tree, many.T_camera_model, s.truth), 0.5e-3);
    ASSERT_TRUE(many.ambiguity);
    // Several starts may end in different depths that fit nearly as well, and then the best must not be trusted either.
    const bool clear = *many.ambiguity <= 0.9;
    EXPECT_EQ(many.status, clear ? RegistrationStatus::kConverged : RegistrationStatus::kAmbiguous) << many.reason;
    EXPECT_GT(*many.ambiguity, 0) << "a start that failed is another answer";
    EXPECT_LE(*many.ambiguity, 1);
  }
  EXPECT_EQ(rescued, 1) << "no start failed, nothing was tested";
}

TEST(Search, OneStartIsPlainAlignmentWithoutAmbiguity) {
  StartScene s(0);
  const auto registration = makeRegistration(s.settings, s.tree);
  const auto one = registration->search(s.image, s.camera, s.prior, StartSettings());
  EXPECT_FALSE(one.ambiguity);
  EXPECT_EQ(one.T_camera_model.matrix(), registration->align(s.image, s.camera, s.prior).T_camera_model.matrix());
}

// As printed the scale starts at the largest squared distance and halves every 5 iterations, whether or not it has come
// to rest: the count of iterations tells.
TEST(Presets, ThePapersScheduleRunsItsFullLength) {
  StartScene s(3);
  Twist off;
  off << 1e-3, -2e-3, 2e-3, degToRad(1), 0, degToRad(0.5);
  s.prior.T_camera_model = test::perturbed(s.truth, s.tree, off);
  double largest2 = 0;
  for (int i = 0; i < s.tree.size(); ++i) {
    const Eigen::Vector2d pixel = *s.camera.project(s.prior.T_camera_model * s.tree.points().col(i));
    largest2 = std::max(largest2, (s.image.points_px.colwise() - pixel).colwise().squaredNorm().minCoeff());
  }
  const int halvings = static_cast<int>(std::ceil(std::log2(largest2)));
  ASSERT_GT(halvings, 4);
  const auto paper = makeRegistration(registrationSettingsNamed("iterative_pnp:paper"), s.tree);
  const auto printed = paper->align(s.image, s.camera, s.prior);
  EXPECT_GT(printed.rigid_iterations, 5 * halvings);
  EXPECT_LE(printed.rigid_iterations, 100);
  const auto own = makeRegistration(IterativePnpSettings(), s.tree)->align(s.image, s.camera, s.prior);
  EXPECT_LT(own.rigid_iterations, printed.rigid_iterations);
}

TEST(Presets, AreFoundByTheirNamesAndOthersRefused) {
  const auto paper = std::get<IterativePnpSettings>(registrationSettingsNamed("iterative_pnp:paper"));
  EXPECT_EQ(paper.neighbours_each_side, 0);
  EXPECT_EQ(paper.prior, PriorForm::kPaper);
  const auto best = std::get<IterativePnpSettings>(registrationSettingsNamed("iterative_pnp:best"));
  EXPECT_EQ(best.prior, PriorForm::kCovariance);
  EXPECT_EQ(startsOfPreset("iterative_pnp:best"), 16);
  EXPECT_EQ(startsOfPreset("iterative_pnp"), 0);
  EXPECT_EQ(std::get<CvoSettings>(registrationSettingsNamed("cvo:source")).objective, CvoObjective::kInnerProduct);
  EXPECT_LE(std::get<NicpSettings>(registrationSettingsNamed("nicp:source")).first_scale_px,
            NicpSettings::in_plane_above_px);
  EXPECT_THAT(test::refusalOf([] { registrationSettingsNamed("iterative_pnp:bset"); }),
              testing::AllOf(testing::HasSubstr("iterative_pnp:bset"), testing::HasSubstr("iterative_pnp:best")));
}

TEST(PriorInForce, IsSaid) {
  StartScene s(0);
  PosePrior given = s.prior;
  given.covariance = Matrix6d(1e-4 * Matrix6d::Identity());
  const auto inForce = [&](const RegistrationSettings& settings, const PosePrior& prior) {
    return makeRegistration(settings, s.tree)->align(s.image, s.camera, prior).prior;
  };
  EXPECT_EQ(inForce(IterativePnpSettings(), s.prior), PriorInForce::kLambda);
  EXPECT_EQ(inForce(s.settings, s.prior), PriorInForce::kSettingsCovariance);
  EXPECT_EQ(inForce(IterativePnpSettings(), given), PriorInForce::kGivenCovariance);
  EXPECT_EQ(inForce(OrientedKernelSettings(), s.prior), PriorInForce::kSettingsCovariance);
  EXPECT_EQ(inForce(OrientedKernelSettings(), given), PriorInForce::kGivenCovariance);
  s.image = makeCenterline(Eigen::Matrix2Xd(2, 0));  // Too few points to begin with.
  EXPECT_EQ(inForce(IterativePnpSettings(), s.prior), PriorInForce::kLambda);
  EXPECT_EQ(inForce(OrientedKernelSettings(), given), PriorInForce::kGivenCovariance);
}

TEST(Search, APoseThatFitsAsWellAsAnotherIsAmbiguous) {
  // A straight vessel may turn about itself, or slide along a longer one in the image: many poses fit it equally.
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, 61);
  std::vector<int> parents;
  for (int i = 0; i < 61; ++i) {
    points.col(i) << 1e-3 * (i - 30), 2e-6 * (i - 30) * (i - 30), 0;
    parents.push_back(i - 1);
  }
  const VesselTree tree(points, parents);
  Pose T = Pose::Identity();
  T.translation().z() = 0.75;
  const XrayCamera camera = test::clinicalCamera();
  const auto registration = makeRegistration(IterativePnpSettings(), tree);
  StartSettings starts;
  starts.count = 6;
  starts.translation_std_mm = 15;
  // Three vessels alike, side by side: each start falls to its own.
  std::vector<int> branch;
  Eigen::Matrix2Xd pixels(2, 183);
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 61; ++i) {
      pixels.col(61 * k + i) = *camera.project(T * points.col(i)) + Eigen::Vector2d(0, 60 * (k - 1));
      branch.push_back(k);
    }
  }
  const auto result = registration->search(makeCenterline(pixels, branch), camera, {T, std::nullopt}, starts);
  ASSERT_TRUE(result.ambiguity);
  EXPECT_GT(*result.ambiguity, 0.9);
  EXPECT_LE(*result.ambiguity, 1);
  EXPECT_NE(result.status, RegistrationStatus::kConverged);
}

TEST(Search, RefusesStartsThatAreNone) {
  StartScene s(0);
  StartSettings starts;
  starts.count = -1;
  const auto registration = makeRegistration(s.settings, s.tree);
  EXPECT_THAT(test::refusalOf([&] { (void)registration->search(s.image, s.camera, s.prior, starts); }),
              testing::HasSubstr("count = -1"));
}

TEST(DrawnPose, HasTheSpreadThatIsAskedForAboutTheCenter) {
  test::Random random(1);
  const Pose T = expSE3(random.twist(1, 1));
  const Eigen::Vector3d center(0.1, -0.2, 0.3);
  const Eigen::Translation3d to_center(center);
  const int draws = 2000;
  Twist sum = Twist::Zero(), squares = Twist::Zero();
  for (int i = 0; i < draws; ++i) {
    const Pose drawn = to_center.inverse() * T.inverse() * drawnPose(T, center, 0.05, 4e-3, 9, i) * to_center;
    Twist xi;
    xi << drawn.translation(), logSO3(drawn.linear());
    sum += xi;
    squares += xi.cwiseAbs2();
  }
  const Twist expected = (Twist() << 4e-3, 4e-3, 4e-3, 0.05, 0.05, 0.05).finished();
  for (int k = 0; k < 6; ++k) {
    // A standard deviation of n draws scatters by 1/sqrt(2n), a mean by 1/sqrt(n): 1.6 % and 2.2 %; four of each.
    EXPECT_NEAR(std::sqrt(squares[k] / draws) / expected[k], 1, 0.064) << k;
    EXPECT_NEAR(sum[k] / draws / expected[k], 0, 0.09) << k;
  }
}

TEST(DrawnPose, IsTheSameForOneSeedAndIndexAndAnotherForAnyOther) {
  const Pose T = Pose::Identity();
  const Eigen::Vector3d c = Eigen::Vector3d::Zero();
  EXPECT_EQ(drawnPose(T, c, 0.1, 0.1, 3, 5).matrix(), drawnPose(T, c, 0.1, 0.1, 3, 5).matrix());
  EXPECT_NE(drawnPose(T, c, 0.1, 0.1, 3, 5).matrix(), drawnPose(T, c, 0.1, 0.1, 3, 6).matrix());
  EXPECT_NE(drawnPose(T, c, 0.1, 0.1, 3, 5).matrix(), drawnPose(T, c, 0.1, 0.1, 4, 5).matrix());
  EXPECT_LT((drawnPose(T, c, 0, 0, 3, 5).matrix() - T.matrix()).norm(), 1e-15);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// What oriented kernels promise beyond what every method must do.
#include <gtest/gtest.h>

#include "angio/geometry/decompositions.hpp"
#include "angio/registration/registration.hpp"
#include "angio/registration/starts.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "fit_classification.hpp"
#include "kernel_scene.hpp"
#include "mean_distance.hpp"

namespace angio::test {
namespace {

Centerline2d withNoise(const Centerline2d& image, double noise_px, test::Random& random) {
  Eigen::Matrix2Xd points = image.points_px;
  for (int i = 0; i < points.cols(); ++i) {
    const double dx = random.normal(), dy = random.normal();
    points.col(i) += noise_px * Eigen::Vector2d(dx, dy);
  }
  return makeCenterline(points, image.branch);
}

TEST(OrientedKernel, FindsThePoseFromStartsThatLoseTheVessel) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const KernelScene s(seed);
    const auto registration = makeRegistration(OrientedKernelSettings(), s.tree);
    for (int i = 0; i < 4; ++i) {
      const Pose start = drawnPose(s.truth, s.tree.centroid(), degToRad(5), 10e-3, 31, i);
      const auto result = registration->search(s.image, s.camera, {start, {}}, {});
      EXPECT_EQ(result.status, RegistrationStatus::kConverged) << result.reason;
      EXPECT_LT(meanDistance(s.tree, result.T_camera_model, s.truth), 0.1e-3) << seed << " " << i;
    }
  }
}

// A window that shows a part of the tree: the rest must not pull it together.
TEST(OrientedKernel, HoldsDepthWhenHalfOfTheTreeIsOutOfView) {
  XrayCamera::Parameters window = test::clinicalCamera().parameters();
  window.width_px = window.height_px = 300;
  window.cx_px -= 360;
  window.cy_px -= 330;
  int half_seen = 0;
  for (unsigned seed = 0; seed < 8; ++seed) {
    const KernelScene s(seed, XrayCamera(window));
    const KernelScene whole(seed);
    const double share = static_cast<double>(s.image.size()) / whole.image.size();
    if (share < 0.25 || share > 0.75) continue;
    ++half_seen;
    test::Random random(seed);
    const Centerline2d image = withNoise(s.image, 1, random);
    const Pose start = drawnPose(s.truth, s.tree.centroid(), degToRad(2), 5e-3, 5, static_cast<int>(seed));
    const auto result = makeRegistration(OrientedKernelSettings(), s.tree)->search(image, s.camera, {start, {}}, {});
    EXPECT_LT(meanDistance(s.tree, result.T_camera_model, s.truth), 2e-3) << seed << ": " << share;
  }
  EXPECT_GE(half_seen, 3);
}

TEST(OrientedKernel, TwoViewsAreOneProblemAndHoldDepthToHundredthsOfAMillimetre) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    const KernelScene s(seed);
    test::Random random(seed + 9);
    // The second plane stands across the first one, about the tree.
    const Eigen::Translation3d to_iso(0, 0, 0.75);
    const Pose T_second_first =
        Pose(to_iso * Eigen::AngleAxisd(degToRad(85), Eigen::Vector3d::UnitY()) * to_iso.inverse());
    const Centerline2d first = withNoise(s.image, 1, random);
    const Centerline2d second = withNoise(projectedCenterline(s.tree, s.camera, T_second_first * s.truth), 1, random);
    const Pose start = drawnPose(s.truth, s.tree.centroid(), degToRad(5), 10e-3, 8, static_cast<int>(seed));
    const XrayViews views = {{first, s.camera}, {second, s.camera, T_second_first}};
    const auto result = makeRegistration(OrientedKernelSettings(), s.tree)->search(views, {start, {}}, {});
    EXPECT_EQ(result.status, RegistrationStatus::kConverged) << result.reason;
    // A pixel is 0.19 mm; some hundred points in two directions leave a tenth of it.
    EXPECT_LT(meanDistance(s.tree, result.T_camera_model, s.truth), 0.1e-3);
  }
}

// Every other branch is ten times as noisy. Who knows which weighs them by it, and is nearer to the truth.
TEST(OrientedKernel, CertainPointsCountMore) {
  double squares_knowing = 0, squares_not = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    const KernelScene s(seed % 6);
    test::Random random(seed + 70);
    Eigen::Matrix2Xd points = s.image.points_px;
    Eigen::VectorXd std_px(points.cols());
    for (int i = 0; i < points.cols(); ++i) {
      std_px[i] = s.image.branch[static_cast<std::size_t>(i)] % 2 ? 3 : 0.3;
      const double dx = random.normal(), dy = random.normal();
      points.col(i) += std_px[i] * Eigen::Vector2d(dx, dy);
    }
    Centerline2d image = makeCenterline(points, s.image.branch);
    image.tangent_rad = s.image.tangent_rad;  // Positions alone are compared.
    const auto registration = makeRegistration(OrientedKernelSettings(), s.tree);
    const auto squared = [&] {
      const auto result = registration->align(image, s.camera, {s.truth, {}});
      return std::pow(meanDistance(s.tree, result.T_camera_model, s.truth), 2);
    };
    squares_not += squared();
    image.std_px = std_px;
    squares_knowing += squared();
  }
  EXPECT_LT(std::sqrt(squares_knowing), 0.7 * std::sqrt(squares_not));
}

// The covariance of the noise is the scatter: over many noisy images the squared error, weighed by it, is a chi-square
// of six. The whole covariance is wider: the image does not exclude a small deformation.
TEST(OrientedKernel, CovarianceIsTheScatterUnderPixelNoise) {
  const int trials = 500;
  double sum = 0;
  for (int trial = 0; trial < trials; ++trial) {
    static const std::vector<KernelScene> scenes = [] {
      std::vector<KernelScene> some;
      for (unsigned seed = 0; seed < 5; ++seed) some.emplace_back(seed);
      return some;
    }();
    static const std::vector<std::unique_ptr<Registration>> registrations = [] {
      std::vector<std::unique_ptr<Registration>> some;
      OrientedKernelSettings settings;
      settings.prior_rotation_std_deg = 10;  // The prior is no part of this.
      settings.prior_translation_std_mm = 100;
      for (const KernelScene& s : scenes) some.push_back(makeRegistration(settings, s.tree));
      return some;
    }();
    const KernelScene& s = scenes[static_cast<std::size_t>(trial) % scenes.size()];
    test::Random random(static_cast<unsigned>(trial) + 1000);
    const Centerline2d image = withNoise(s.image, 1, random);
    const Pose start = drawnPose(s.truth, s.tree.centroid(), degToRad(0.3), 1e-3, 77, trial);
    auto& registration = *registrations[static_cast<std::size_t>(trial) % scenes.size()];
    const auto result = registration.align(image, s.camera, {start, {}});
    ASSERT_TRUE(result.covariance && result.noise_covariance);
    Vector6d e;
    e << s.truth.translation() - result.T_camera_model.translation(),
        logSO3(s.truth.linear() * result.T_camera_model.linear().transpose());
    sum += squaredMahalanobis(e, *result.noise_covariance);
    EXPECT_LT(squaredMahalanobis(e, *result.covariance), squaredMahalanobis(e, *result.noise_covariance));
  }
  // The mean of 500 chi-squares of six: 95 % within 1.96 sqrt(12 / 500) of six.
  RecordProperty("nees", std::to_string(sum / trials));
  EXPECT_NEAR(sum / trials, 6, 0.304);
}

// Flat trees look the same from front and back, nearly: the wrong one must not be trusted.
TEST(OrientedKernel, ADepthMirroredFitIsNotTrusted) {
  int mirrored_fits = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const VesselTree grown = test::branchingTree(seed);
    Eigen::Matrix3Xd flat = grown.points().colwise() - grown.centroid();
    flat.row(2) *= 0.03;
    const VesselTree tree(flat, grown.parents(), grown.radii());
    const double tilt_rad = degToRad(12), roll_rad = 0.4;
    const auto tilted = [&](double tilt) {
      Pose T = Pose::Identity();
      T.linear() = (Eigen::AngleAxisd(tilt, Eigen::Vector3d(0.8, -0.6, 0)) *
                    Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()))
                       .toRotationMatrix();
      T.translation() = Eigen::Vector3d(0, 0, 0.75) - T.linear() * tree.centroid();
      return T;
    };
    const Pose truth = tilted(tilt_rad), mirrored = tilted(-tilt_rad);  // Near and far exchanged.
    const XrayCamera camera = test::clinicalCamera();
    test::Random random(seed + 70);
    // A real image is not the model's to the pixel: a smooth error of two pixels hides what perspective tells front
    // from back.
    Centerline2d warped = projectedCenterline(tree, camera, truth);
    for (int i = 0; i < warped.size(); ++i) {
      const Eigen::Vector2d q = warped.points_px.col(i);
      warped.points_px.col(i) += 2 * Eigen::Vector2d(std::sin(q.y() / 120 + seed), std::sin(q.x() / 140 + 2 * seed));
    }
    const Centerline2d image = withNoise(warped, 0.7, random);
    Vector6d variance;
    variance << Eigen::Vector3d::Constant(4e-6), Eigen::Vector3d::Constant(std::pow(degToRad(5), 2));
    const PosePrior prior{mirrored, Matrix6d(variance.asDiagonal())};
    const auto result = makeRegistration(OrientedKernelSettings(), tree)->align(image, camera, prior);
    const bool wrong =
        meanDistance(tree, result.T_camera_model, mirrored) < meanDistance(tree, result.T_camera_model, truth);
    mirrored_fits += wrong;
    if (wrong) {
      EXPECT_NE(result.status, RegistrationStatus::kConverged) << seed;
    }
    const auto found = makeRegistration(OrientedKernelSettings(), tree)->search(image, camera, prior, {});
    if (found.status == RegistrationStatus::kConverged) {
      EXPECT_LT(meanDistance(tree, found.T_camera_model, truth), meanDistance(tree, found.T_camera_model, mirrored))
          << seed;
    }
  }
  EXPECT_GE(mirrored_fits, 3) << "the trap was not there";
}

// Noise, curves, strangers: many starts must not find in them what is not there.
TEST(OrientedKernel, ASearchTrustsNothingInWhatIsNotItsTree) {
  int trusted = 0, looked = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const KernelScene s(seed), stranger(seed + 40);
    test::Random random(seed);
    Eigen::Matrix2Xd scattered(2, 1500);
    for (int i = 0; i < 1500; ++i) {
      const double u = random.uniform(0, 1023), v = random.uniform(0, 1023);
      scattered.col(i) << u, v;
    }
    const auto registration = makeRegistration(OrientedKernelSettings(), s.tree);
    PosePrior prior{s.truth, Matrix6d(Vector6d(Vector6d::Constant(1e-4)).asDiagonal())};
    for (const auto& image : {makeCenterline(scattered), projectedCenterline(stranger.tree, s.camera, s.truth)}) {
      const auto result = registration->search(image, s.camera, prior, {});
      trusted += result.status == RegistrationStatus::kConverged;
      ++looked;
      ASSERT_TRUE(result.ambiguity);
    }
  }
  EXPECT_EQ(trusted, 0) << "of " << looked;
}

// Mirroring model and image is another patient and another detector, but the same problem.
TEST(OrientedKernel, MirroringBothSidesMirrorsTheAnswer) {
  const KernelScene s(3);
  test::Random random(4);
  const Centerline2d image = withNoise(s.image, 0.5, random);
  const Eigen::Vector3d flip(-1, 1, 1);
  const VesselTree mirrored_tree(flip.asDiagonal() * s.tree.points(), s.tree.parents(), s.tree.radii());
  Eigen::Matrix2Xd pixels = image.points_px;
  pixels.row(0) = 2 * s.camera.parameters().cx_px - pixels.row(0).array();
  const auto mirrorOf = [&](const Pose& T) {
    Pose m = T;
    m.linear() = flip.asDiagonal() * T.linear() * flip.asDiagonal();
    m.translation() = flip.asDiagonal() * T.translation();
    return m;
  };
  Twist by;
  by << 2e-3, -1e-3, 3e-3, 0.01, -0.012, 0.008;
  const Pose start = test::perturbed(s.truth, s.tree, by);
  const auto a = makeRegistration(OrientedKernelSettings(), s.tree)->align(image, s.camera, {start, {}});
  const auto b = makeRegistration(OrientedKernelSettings(), mirrored_tree)
                     ->align(makeCenterline(pixels, image.branch), s.camera, {mirrorOf(start), {}});
  EXPECT_EQ(a.status, b.status);
  // The fields' cells do not lie mirrored: what they leave, the line fit takes, to where its matches change.
  EXPECT_LT(meanDistance(mirrored_tree, mirrorOf(a.T_camera_model), b.T_camera_model), 20e-6);
}

// A catheter in a tree: few image points, and most of the model has no part in them.
TEST(OrientedKernel, ASmallImageFindsItsPlaceInALargeTree) {
  int right = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const KernelScene s(seed);
    // From the root to an end: one path through the tree.
    std::vector<int> path;
    for (int at = s.tree.branches().back().back(); at >= 0; at = s.tree.parents()[static_cast<std::size_t>(at)])
      path.push_back(at);
    Eigen::Matrix2Xd pixels(2, static_cast<Eigen::Index>(path.size()));
    for (std::size_t i = 0; i < path.size(); ++i) {
      pixels.col(static_cast<Eigen::Index>(i)) = *s.camera.project(s.truth * s.tree.points().col(path[i]));
    }
    const Centerline2d catheter = makeCenterline(pixels, std::vector<int>(path.size(), 0));
    Twist by;
    by << 20e-3, -15e-3, 0, 0.02, -0.01, 0.02;
    OrientedKernelSettings settings;
    const auto result =
        makeRegistration(settings, s.tree)->search(catheter, s.camera, {test::perturbed(s.truth, s.tree, by), {}}, {});
    EXPECT_LT(result.alignment.image_residual_px, 1.5) << seed;
    double across = 0;  // Where the pose puts the path, against where it is.
    for (const int i : path) {
      across += (*s.camera.project(result.T_camera_model * s.tree.points().col(i)) -
                 *s.camera.project(s.truth * s.tree.points().col(i)))
                    .norm() /
                static_cast<double>(path.size());
    }
    right += across < 8;
  }
  // One curve fits in more than one place, and nobody can know: most are to be right.
  EXPECT_GE(right, 4);
}

TEST(OrientedKernel, ABoxOfPosesIsSearchedToItsCorners) {
  const KernelScene s(2);
  const auto registration = makeRegistration(OrientedKernelSettings(), s.tree);
  StartSettings box;
  box.box_rotation_deg = 45;
  box.box_translation_mm = 60;
  int found = 0;
  for (int i = 0; i < 5; ++i) {
    test::Random random(static_cast<unsigned>(i) + 5);
    Twist by;
    for (int k = 0; k < 6; ++k) by[k] = (k < 3 ? 0.055 : degToRad(40)) * random.uniform(-1, 1);
    double last = 0;
    const auto result = registration->search({XrayView{s.image, s.camera}}, {test::perturbed(s.truth, s.tree, by), {}},
                                             box, [&](double share) {
                                               EXPECT_GE(share, last);
                                               last = share;
                                             });
    EXPECT_EQ(last, 1);
    found += meanDistance(s.tree, result.T_camera_model, s.truth) < 0.5e-3;
  }
  EXPECT_EQ(found, 5);
}

}  // namespace
}  // namespace angio::test

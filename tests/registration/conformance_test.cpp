// SPDX-License-Identifier: GPL-2.0-or-later
// What every registration method must do, whatever it does inside. A new method joins by standing in
// RegistrationSettings.
#include <gmock/gmock.h>

#include <opencv2/core/mat.hpp>
#include <type_traits>

#include "angio/registration/registration.hpp"
#include "angio/registration/result.hpp"
#include "angio/registration/starts.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/types_of.hpp"
#include "angio/vessel/projection.hpp"
#include "biplane.hpp"
#include "picture.hpp"

namespace angio::test {
namespace {

/// Settings for a clean image and a start that is off: the defaults, unless a method believes its start too much for
/// that.
template <typename Settings>
struct OnCleanImages {
  static Settings settings() { return {}; }
};

template <>
struct OnCleanImages<IterativePnpSettings> {
  static IterativePnpSettings settings() {
    IterativePnpSettings s;
    s.prior = PriorForm::kCovariance;
    s.prior_rotation_std_deg = 5;
    s.prior_translation_std_mm = 20;
    return s;
  }
};

/// How far apart two answers to the same problem may be that reach it by other roundings [m]. Iterations carry a
/// rounding on; a nearest point that changes for it would make micrometres.
template <typename Settings>
struct Rounding {
  static constexpr double kSame_m = 1e-6;
};

/// Single precision, where a ten-thousandth of a pixel decides whether a point is inside a gate.
template <>
struct Rounding<OrientedKernelSettings> {
  static constexpr double kSame_m = 40e-6;
};

// Rigid, and nonrigid where the method can.
template <typename Settings>
std::vector<Settings> variants(const Settings& rigid) {
  std::vector<Settings> all{rigid};
  if constexpr (CanDeform<Settings>::value) {
    all.push_back(rigid);
    all.back().deformation = Deformation::kNonrigid;
  }
  return all;
}

/// What a method can tell of a clean image. Half a pixel is a tenth of a millimetre in the patient, and a tenth of the
/// distance between vessels that cross.
template <typename Settings>
struct Accuracy {
  static constexpr double kRight_px = 0.5;
  /// Of the centroid in two views, which have a pixel of noise for those who look at the centreline: it is 0.2 mm in
  /// the patient, and hundreds of points share it; in one view it leaves several times this in depth.
  static constexpr double kRightInTwoViews_m = 0.1e-3;
  /// Whether one view tells depth well enough to be believed.
  static constexpr bool kOneViewTellsDepth = true;
};

/// A network that sees 96 x 96 pixels: one of them is five of the image. It says that it does not know depth.
template <>
struct Accuracy<PairwiseDnnSettings> {
  static constexpr double kRight_px = 3;
  static constexpr double kRightInTwoViews_m = 0.5e-3;
  static constexpr bool kOneViewTellsDepth = false;
};

struct Scene {
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  Pose truth;
  PosePrior prior;  // Off by 1 degree and 3 mm.
  Centerline2d image;

  explicit Scene(unsigned seed) : tree(test::branchingTree(seed)) {
    test::Random random(seed + 100);
    truth = test::viewOf(tree, random);
    Twist off;
    off << 3e-3 * random.direction(), degToRad(1) * random.direction();
    prior.T_camera_model = test::perturbed(truth, tree, off);
    image = projectedCenterline(tree, camera, truth);
  }

  ShownTree shown() const { return {tree, truth}; }
};

// A pixel of noise, so that a method comes to rest somewhere it has to find and not at a perfect fit.
Centerline2d noisy(const Centerline2d& image, unsigned seed) {
  test::Random random(seed);
  Eigen::Matrix2Xd points = image.points_px;
  for (int i = 0; i < points.cols(); ++i) points.col(i) += Eigen::Vector2d(random.normal(), random.normal());
  return makeCenterline(points, image.branch);
}

// Mean distance between where two poses of two shapes put the same points in the image [px].
double meanPixelDistance(const Scene& s, const Pose& a, const Eigen::Matrix3Xd& points_a, const Pose& b,
                         const Eigen::Matrix3Xd& points_b) {
  double sum = 0;
  for (int i = 0; i < s.tree.size(); ++i) {
    sum += (*s.camera.project(a * points_a.col(i)) - *s.camera.project(b * points_b.col(i))).norm();
  }
  return sum / s.tree.size();
}

void expectFinite(const RegistrationResult& r) {
  EXPECT_TRUE(r.T_camera_model.matrix().allFinite());
  EXPECT_LT(rotationDefect(r.T_camera_model.linear()), 1e-9);
  EXPECT_TRUE(r.displacements_m.allFinite());
  if (r.covariance) {
    EXPECT_TRUE(r.covariance->allFinite());
  }
  const AlignmentScore& a = r.alignment;
  for (const double x : {a.model_explained, a.image_explained, a.model_residual_px, a.image_residual_px, a.model_rms_px,
                         r.times.prepare_s, r.times.rigid_s, r.times.nonrigid_s, r.times.total_s}) {
    EXPECT_TRUE(std::isfinite(x));
    EXPECT_GE(x, 0);
  }
  EXPECT_EQ(r.reason.empty(), r.status == RegistrationStatus::kConverged) << r.reason;
}

/// A simplex ends where its function no longer tells, a tenth of a pixel; other roundings take it elsewhere.
template <>
struct Rounding<AutoMaskSettings> {
  static constexpr double kSame_m = 0.3e-3;
};

template <typename Settings>
struct RegistrationConformance : testing::Test {
  const Settings clean = OnCleanImages<Settings>::settings();

  // Methods that look at the X-ray image have one of the tree that is shown, or else of the centreline.
  static RegistrationResult aligned(Registration& registration, const Centerline2d& image, const XrayCamera& camera,
                                    const PosePrior& prior, const std::optional<ShownTree>& shown = std::nullopt) {
    const SeenScene scene({{image, camera}}, imageNeeded(Settings{}), shown);
    return registration.align(scene.views(), prior, prior.T_camera_model);
  }
  static RegistrationResult aligned(const Settings& settings, const VesselTree& tree, const Centerline2d& image,
                                    const XrayCamera& camera, const PosePrior& prior,
                                    const std::optional<ShownTree>& shown = std::nullopt) {
    return aligned(*makeRegistration(settings, tree), image, camera, prior, shown);
  }
};
TYPED_TEST_SUITE(RegistrationConformance, typename test::TypesOf<RegistrationSettings>::type);

TYPED_TEST(RegistrationConformance, RecoversAKnownPose) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const Scene s(seed);
    ASSERT_GT(meanPixelDistance(s, s.prior.T_camera_model, s.tree.points(), s.truth, s.tree.points()), 5);
    const auto result = this->aligned(this->clean, s.tree, s.image, s.camera, s.prior, s.shown());
    expectFinite(result);
    if (Accuracy<TypeParam>::kOneViewTellsDepth) {
      EXPECT_EQ(result.status, RegistrationStatus::kConverged) << seed << ": " << result.reason;
    } else {
      EXPECT_TRUE(explained(result));
      EXPECT_THAT(result.reason, testing::HasSubstr("leaves the pose open")) << seed;
    }
    EXPECT_LT(meanPixelDistance(s, result.T_camera_model, s.tree.points(), s.truth, s.tree.points()),
              Accuracy<TypeParam>::kRight_px);
  }
}

// One view tells depth least; what looks from the side sees it as it is.
TYPED_TEST(RegistrationConformance, ASecondViewFindsTheDepth) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    const Scene s(seed);
    const Pose T_side_first = test::fromTheSide();
    const Centerline2d front = noisy(s.image, seed + 60);
    const Centerline2d side = noisy(projectedCenterline(s.tree, s.camera, T_side_first * s.truth), seed + 70);
    const XrayViews views{{front, s.camera}, {side, s.camera, T_side_first}};
    for (const auto& settings : variants(this->clean)) {
      const SeenScene scene(views, imageNeeded(settings), s.shown());
      const auto result = makeRegistration(settings, s.tree)->align(scene.views(), s.prior, s.prior.T_camera_model);
      expectFinite(result);
      EXPECT_EQ(result.status, RegistrationStatus::kConverged) << seed << ": " << result.reason;
      EXPECT_GT(result.alignment.model_points, 1.9 * s.tree.size()) << "both views count";
      Eigen::Matrix3Xd found = s.tree.points();
      if (result.displacements_m.size() > 0) found += result.displacements_m;
      const Eigen::Vector3d off = (result.T_camera_model * found - s.truth * s.tree.points()).rowwise().mean();
      EXPECT_LT(off.norm(), Accuracy<TypeParam>::kRightInTwoViews_m) << seed;
    }
  }
}

TYPED_TEST(RegistrationConformance, WhatConvergedFromFarOffIsRight) {
  const Scene s(3);
  const auto registration = makeRegistration(this->clean, s.tree);
  for (int i = 0; i < 25; ++i) {
    const Pose start = drawnPose(s.truth, s.tree.centroid(), degToRad(8), 12e-3, 9, i);
    const auto result = this->aligned(*registration, s.image, s.camera, {start, {}}, s.shown());
    if (result.status != RegistrationStatus::kConverged) continue;
    // A loop that trusts it would put the target this far off; depth is the last thing a solver finds.
    EXPECT_LT((result.T_camera_model * s.tree.centroid() - s.truth * s.tree.centroid()).norm(), 5e-3) << i;
  }
}

TYPED_TEST(RegistrationConformance, MovesWithTheModelWhenItsFrameMoves) {
  const Scene s(1);
  test::Random random(7);
  const Pose G = expSE3(random.twist(0.1, 1));
  const Centerline2d image = noisy(s.image, 8);
  const VesselTree moved(G * s.tree.points(), s.tree.parents(), s.tree.radii());
  for (const auto& settings : variants(this->clean)) {
    const auto a = this->aligned(settings, s.tree, image, s.camera, s.prior, s.shown());
    const auto b =
        this->aligned(settings, moved, image, s.camera, {s.prior.T_camera_model * G.inverse(), {}}, s.shown());
    const Eigen::Matrix3Xd apart = (a.T_camera_model * s.tree.points()) - (b.T_camera_model * moved.points());
    EXPECT_LT(apart.colwise().norm().maxCoeff(), Rounding<TypeParam>::kSame_m);
    EXPECT_EQ(a.status, b.status);
    if (a.displacements_m.size() > 0) {
      EXPECT_LT((G.linear() * a.displacements_m - b.displacements_m).colwise().norm().maxCoeff(),
                Rounding<TypeParam>::kSame_m);
    }
  }
}

TYPED_TEST(RegistrationConformance, IsRepeatableBitForBitWhateverCameBetween) {
  const Scene s(2), other(3);
  for (const auto& settings : variants(this->clean)) {
    const auto registration = makeRegistration(settings, s.tree);
    const auto first = this->aligned(*registration, s.image, s.camera, s.prior, s.shown());
    (void)this->aligned(*registration, other.image, other.camera, other.prior, other.shown());
    const auto again = this->aligned(*registration, s.image, s.camera, s.prior, s.shown());
    const auto fresh = this->aligned(settings, s.tree, s.image, s.camera, s.prior, s.shown());
    for (const auto* r : {&again, &fresh}) {
      EXPECT_EQ(r->T_camera_model.matrix(), first.T_camera_model.matrix());
      EXPECT_EQ(r->displacements_m, first.displacements_m);
      EXPECT_EQ(*r->covariance, *first.covariance);
      EXPECT_EQ(r->alignment.score(), first.alignment.score());
    }
  }
}

TYPED_TEST(RegistrationConformance, TheOrderOfBranchesInTheImageDoesNotMatter) {
  const Scene s(4);
  const Centerline2d image = noisy(s.image, 9);
  // Branches last to first, points within each in their order.
  std::vector<int> order;
  for (int end = image.size(); end > 0;) {
    int begin = end - 1;
    while (begin > 0 && image.branch[begin - 1] == image.branch[end - 1]) --begin;
    for (int i = begin; i < end; ++i) order.push_back(i);
    end = begin;
  }
  Eigen::Matrix2Xd points(2, image.size());
  std::vector<int> branch;
  for (int i = 0; i < image.size(); ++i) {
    points.col(i) = image.points_px.col(order[i]);
    branch.push_back(image.branch[order[i]]);
  }
  const Centerline2d permuted = makeCenterline(points, branch);
  for (const auto& settings : variants(this->clean)) {
    const auto a = this->aligned(settings, s.tree, image, s.camera, s.prior, s.shown());
    const auto b = this->aligned(settings, s.tree, permuted, s.camera, s.prior, s.shown());
    EXPECT_LT((a.T_camera_model.matrix() - b.T_camera_model.matrix()).cwiseAbs().maxCoeff(), 1e-9);
    if (a.displacements_m.size() > 0) {
      EXPECT_LT((a.displacements_m - b.displacements_m).cwiseAbs().maxCoeff(), 1e-9);
    }
  }
}

// Points without order, everywhere on the detector.
Centerline2d randomCurve(test::Random& random, int n) {
  Eigen::Matrix2Xd points(2, n);
  for (int i = 0; i < n; ++i) points.col(i) << random.uniform(0, 1023), random.uniform(0, 1023);
  return makeCenterline(points);
}

// Smooth curves that look like vessels, anywhere on the detector.
Centerline2d randomCurves(test::Random& random, int curves) {
  std::vector<Eigen::Vector2d> points;
  std::vector<int> branch;
  for (int c = 0; c < curves; ++c) {
    Eigen::Vector2d at(random.uniform(100, 900), random.uniform(100, 900));
    double heading = random.uniform(-kPi, kPi), bend = 0.01 * random.normal();
    for (int i = 0; i < 40; ++i) {
      at += 5 * Eigen::Vector2d(std::cos(heading), std::sin(heading));
      heading += bend + 0.02 * random.normal();
      points.push_back(at);
      branch.push_back(c);
    }
  }
  Eigen::Matrix2Xd matrix(2, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return makeCenterline(matrix, branch);
}

TYPED_TEST(RegistrationConformance, NeverSaysConvergedOnWhatIsNotItsTree) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    const Scene s(seed);
    test::Random random(seed + 50);
    const Scene stranger(seed + 20);
    // Another tree in the same place, seen from the side from which this one is looked for.
    const Centerline2d images[] = {randomCurve(random, 1500), randomCurves(random, 25),
                                   projectedCenterline(stranger.tree, s.camera, s.truth)};
    for (const auto& settings : variants(TypeParam{})) {
      const auto registration = makeRegistration(settings, s.tree);
      for (const auto& image : images) {
        const auto result = this->aligned(*registration, image, s.camera, s.prior);
        expectFinite(result);
        EXPECT_NE(result.status, RegistrationStatus::kConverged) << seed << ": image " << &image - images;
      }
    }
  }
}

TYPED_TEST(RegistrationConformance, SaysWhenThereAreTooFewPoints) {
  const Scene s(5);
  Eigen::Matrix3Xd few = s.tree.points().leftCols(3);
  const VesselTree stub(few, {-1, 0, 1});
  for (const auto& settings : variants(TypeParam{})) {
    const auto registration = makeRegistration(settings, s.tree);
    const auto empty = this->aligned(*registration, makeCenterline(Eigen::Matrix2Xd(2, 0)), s.camera, s.prior);
    const auto three = this->aligned(*registration, makeCenterline(s.image.points_px.leftCols(3)), s.camera, s.prior);
    const auto short_tree = this->aligned(settings, stub, s.image, s.camera, s.prior, s.shown());
    for (const auto* r : {&empty, &three, &short_tree}) {
      EXPECT_EQ(r->status, RegistrationStatus::kTooFewPoints);
      EXPECT_EQ(r->T_camera_model.matrix(), s.prior.T_camera_model.matrix()) << "what was known stays what is known";
      expectFinite(*r);
    }
    if constexpr (CanDeform<TypeParam>::value) {
      const int rows = settings.deformation == Deformation::kNonrigid ? s.tree.size() : 0;
      EXPECT_EQ(empty.displacements_m.cols(), rows) << "one for each point of the tree, also when none was found";
    }
  }
}

TYPED_TEST(RegistrationConformance, AStartBehindTheSourceOrBesideTheDetectorIsNoSuccess) {
  const Scene s(6);
  PosePrior behind = s.prior, across = s.prior, beside = s.prior;
  behind.T_camera_model.translation().z() -= 2;
  across.T_camera_model.translation() -= across.T_camera_model * s.tree.centroid();  // The source stands in the tree.
  beside.T_camera_model.translation().x() += 5;
  for (const auto& settings : variants(TypeParam{})) {
    const auto registration = makeRegistration(settings, s.tree);
    for (const auto* prior : {&behind, &across, &beside}) {
      const auto result = this->aligned(*registration, s.image, s.camera, *prior, s.shown());
      expectFinite(result);
      EXPECT_NE(result.status, RegistrationStatus::kConverged);
    }
  }
}

TYPED_TEST(RegistrationConformance, ImagesThatDegenerateGiveFiniteResults) {
  const Scene s(7);
  Eigen::Matrix2Xd one_place = Eigen::Matrix2Xd::Constant(2, 200, 500), one_line(2, 200);
  for (int i = 0; i < 200; ++i) one_line.col(i) << 4 * i, 512;
  Eigen::Matrix2Xd far = s.image.points_px;
  far.array() += 5000;
  for (const auto& settings : variants(TypeParam{})) {
    const auto registration = makeRegistration(settings, s.tree);
    for (const auto& points : {one_place, one_line, far}) {
      for (const auto& image : {makeCenterline(points), makeCenterline(points, std::vector<int>(points.cols(), 0))}) {
        const auto result = this->aligned(*registration, image, s.camera, s.prior);
        expectFinite(result);
        EXPECT_NE(result.status, RegistrationStatus::kConverged);
      }
    }
  }
}

// How far apart the projections of two shapes are across the vessels, on average [px].
double meanDistanceAcross(const Scene& s, const Pose& pose, const Eigen::Matrix3Xd& found,
                          const Eigen::Matrix3Xd& deformed) {
  double sum = 0;
  int counted = 0;
  for (int i = 0; i < s.tree.size(); ++i) {
    const int parent = s.tree.parents()[i];
    if (parent < 0) continue;
    const Eigen::Vector2d u = *s.camera.project(s.truth * deformed.col(i));
    const Eigen::Vector2d edge = u - *s.camera.project(s.truth * deformed.col(parent));
    if (edge.norm() < 1) continue;  // Seen end-on.
    const Eigen::Vector2d apart = *s.camera.project(pose * found.col(i)) - u;
    sum += std::abs(edge.x() * apart.y() - edge.y() * apart.x()) / edge.norm();
    ++counted;
  }
  return sum / counted;
}

// An image of lines shows where a vessel has gone across itself, hardly how far along itself: nearest points slide. So
// the pixel is asked for across the vessels, and along them only that the nonrigid half improves on the rigid one.
TYPED_TEST(RegistrationConformance, NonrigidFollowsASmoothDeformationInTheImagePlane) {
  if constexpr (!CanDeform<TypeParam>::value) {
    RegistrationSettings rigid = this->clean;
    EXPECT_FALSE(setDeformation(rigid, Deformation::kNonrigid)) << "a rigid method says so";
  } else {
    for (unsigned seed = 0; seed < 3; ++seed) {
      const Scene s(seed);
      test::Random random(seed + 30);
      // A wave of 160 mm across the tree that shifts vessels by up to 2 mm, as breathing does.
      const Eigen::Vector3d wave = 2 * kPi / 0.16 * random.direction();
      const Eigen::Vector3d along = s.truth.linear().transpose() * Eigen::Vector3d(0.8, 0.6, 0);
      Eigen::Matrix3Xd deformed = s.tree.points();
      for (int i = 0; i < s.tree.size(); ++i)
        deformed.col(i) += 2e-3 * std::sin(wave.dot(s.tree.points().col(i))) * along;
      const VesselTree deformed_tree(deformed, s.tree.parents(), s.tree.radii());
      const Centerline2d image = projectedCenterline(deformed_tree, s.camera, s.truth);
      const auto both = variants(this->clean);
      const auto rigid = this->aligned(both[0], s.tree, image, s.camera, s.prior);
      const auto nonrigid = this->aligned(both[1], s.tree, image, s.camera, s.prior);
      expectFinite(nonrigid);
      // One view may leave the depth of a deformed tree open: then the result is explained, and not converged.
      EXPECT_TRUE(explained(nonrigid)) << nonrigid.reason;
      if (nonrigid.status != RegistrationStatus::kConverged) {
        EXPECT_EQ(nonrigid.status, RegistrationStatus::kAmbiguous);
        EXPECT_THAT(nonrigid.reason, testing::HasSubstr("leaves the pose open"));
      }
      EXPECT_EQ(rigid.displacements_m.size(), 0);
      ASSERT_EQ(nonrigid.displacements_m.cols(), s.tree.size());
      const Eigen::Matrix3Xd found = s.tree.points() + nonrigid.displacements_m;
      EXPECT_LT(meanDistanceAcross(s, nonrigid.T_camera_model, found, deformed), 1.0);
      EXPECT_LT(meanPixelDistance(s, nonrigid.T_camera_model, found, s.truth, deformed),
                0.8 * meanPixelDistance(s, rigid.T_camera_model, s.tree.points(), s.truth, deformed));
    }
  }
}

TYPED_TEST(RegistrationConformance, IsFoundByItsNameAndRefusesBadSettings) {
  const RegistrationSettings named = registrationSettingsNamed(TypeParam::kName);
  EXPECT_TRUE(std::holds_alternative<TypeParam>(named));
  EXPECT_EQ(methodName(named), TypeParam::kName);
  EXPECT_THAT(test::refusalOf([] { registrationSettingsNamed("no_such_method"); }),
              testing::HasSubstr(TypeParam::kName));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// Methods that look at the X-ray image.
#include <gmock/gmock.h>

#include <opencv2/core.hpp>

#include "angio/registration/registration.hpp"
#include "angio/registration/starts.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "image_gradient.hpp"
#include "nearest_covariance.hpp"
#include "picture.hpp"

namespace angio::test {
namespace {

struct SeenTree {
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  Pose truth;
  Centerline2d centerline;
  cv::Mat image;

  explicit SeenTree(unsigned seed) : tree(test::branchingTree(seed)) {
    test::Random random(seed + 40);
    truth = test::viewOf(tree, random);
    centerline = projectedCenterline(tree, camera, truth);
    image = radiographOf(tree, camera, truth);
  }
  XrayView view() const {
    XrayView view{centerline, camera};
    view.image = &image;
    return view;
  }
};

std::vector<RegistrationSettings> imageMethods() { return {AutoMaskSettings{}, RgrbSettings{}, PairwiseDnnSettings{}}; }

TEST(ImageMethods, FindANearPoseInAnIdealRadiograph) {
  for (const auto& settings : imageMethods()) {
    for (unsigned seed = 0; seed < 3; ++seed) {
      const SeenTree s(seed);
      const Pose start = drawnPose(s.truth, s.tree.centroid(), degToRad(0.5), 1e-3, 3, static_cast<int>(seed));
      const auto result = makeRegistration(settings, s.tree)->align({s.view()}, {start, Matrix6d::Identity()}, start);
      // The paper counts a residual of 2 mm as found, and its pixels are 0.3 mm. A network's is five of the image.
      const bool network = std::holds_alternative<PairwiseDnnSettings>(settings);
      EXPECT_LT(result.alignment.model_rms_px, network ? 3 : 1) << methodName(settings) << " " << seed;
      EXPECT_EQ(result.prior, PriorInForce::kNone) << "what came with the start is not looked at";
    }
  }
}

TEST(ImageMethods, RefuseAViewWithoutAnImage) {
  const SeenTree s(1);
  for (const auto& settings : imageMethods()) {
    EXPECT_TRUE(imageNeeded(settings));
    const auto registration = makeRegistration(settings, s.tree);
    EXPECT_THAT(test::refusalOf([&] {
                  (void)registration->align(s.centerline, s.camera, {s.truth, {}});
                }),
                testing::AllOf(testing::HasSubstr(methodName(settings)), testing::HasSubstr("needs the X-ray image")));
  }
  const cv::Mat small(s.image, cv::Rect(0, 0, 100, 100));
  XrayView cut = s.view();
  cut.image = &small;
  EXPECT_THAT(test::refusalOf([&] {
                (void)makeRegistration(RgrbSettings{}, s.tree)->align({cut}, {s.truth, {}}, s.truth);
              }),
              testing::HasSubstr("of their camera's size"));
  EXPECT_FALSE(imageNeeded(OrientedKernelSettings{}));
  EXPECT_FALSE(imageNeeded(IterativePnpSettings{}));
}

TEST(ImageMethods, AreRigid) {
  for (RegistrationSettings settings : imageMethods()) {
    EXPECT_TRUE(setDeformation(settings, Deformation::kRigid));
    EXPECT_FALSE(setDeformation(settings, Deformation::kNonrigid));
  }
  RegistrationSettings deforms = IterativePnpSettings{};
  ASSERT_TRUE(setDeformation(deforms, Deformation::kNonrigid));
  EXPECT_EQ(std::get<IterativePnpSettings>(deforms).deformation, Deformation::kNonrigid);
}

// Of an image whose values are a plane the gradient is its slope, wherever it is read.
TEST(ImageGradient, IsTheSlopeOfAPlane) {
  cv::Mat plane(60, 80, CV_32FC1);
  for (int y = 0; y < plane.rows; ++y) {
    for (int x = 0; x < plane.cols; ++x)
      plane.at<float>(y, x) = 0.3F * static_cast<float>(x) - 0.2F * static_cast<float>(y);
  }
  const ImageGradient gradient(plane, 1.5);
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(30, 20), Eigen::Vector2d(40.25, 31.75)}) {
    // Single precision of values up to 24.
    EXPECT_LT((gradient.at(at) - Eigen::Vector2d(0.3, -0.2)).norm(), 1e-5);
  }
  EXPECT_EQ(gradient.at({-1, 5}), Eigen::Vector2d::Zero());
  EXPECT_EQ(gradient.at({5, 60}), Eigen::Vector2d::Zero());
}

// The logarithm makes a vessel as dark behind bone as beside it: half of the light, the same attenuation.
TEST(VesselAttenuation, DoesNotDependOnTheLight) {
  cv::Mat bright(300, 300, CV_16UC1, cv::Scalar(40000));
  bright.colRange(140, 144) = 30000;
  const cv::Mat dim = bright / 2;
  cv::Mat apart;
  cv::absdiff(vesselAttenuation(bright), vesselAttenuation(dim), apart);
  double most = 0;
  cv::minMaxLoc(apart, nullptr, &most);
  EXPECT_LT(most, 1e-4);  // A count more in 15,000, so that black has a logarithm.
  EXPECT_NEAR(vesselAttenuation(bright).at<float>(150, 142), std::log(4.0 / 3), 0.02);
}

// Twice the residuals, four times the variance; and what the given prior knows, the result knows at least.
TEST(CovarianceByNearest, GrowsWithTheResidualsAndKeepsWhatWasKnown) {
  const SeenTree s(2);
  const Eigen::Matrix3Xd centered = s.tree.points().colwise() - s.tree.centroid();
  const Pose T = s.truth * Eigen::Translation3d(s.tree.centroid());
  test::Random random(8);
  Eigen::Matrix2Xd noise(2, s.centerline.size());
  for (int i = 0; i < noise.cols(); ++i) noise.col(i) << random.normal(), random.normal();
  const auto covariance = [&](double noise_px, const PosePriorTerm& prior) {
    // Far less than the distance between points: the nearest one stays the nearest one.
    const Centerline2d seen = makeCenterline(s.centerline.points_px + noise_px * noise);
    return covarianceByNearest(centered, {{seen, s.camera}}, T, prior, s.tree.centroid());
  };
  const PosePriorTerm none = givenPrior({s.truth, {}}, s.tree.centroid());
  const auto once = covariance(0.02, none), twice = covariance(0.04, none);
  ASSERT_TRUE(once && twice);
  EXPECT_NEAR((*twice)(0, 0) / (*once)(0, 0), 4, 0.2);
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(1e-6), Eigen::Vector3d::Constant(1e-6);
  const PosePriorTerm known = givenPrior({s.truth, Matrix6d(variance.asDiagonal())}, s.tree.centroid());
  EXPECT_EQ(known.source, PriorInForce::kGivenCovariance);
  EXPECT_LT(covariance(0.02, known)->trace(), once->trace());
}

}  // namespace
}  // namespace angio::test

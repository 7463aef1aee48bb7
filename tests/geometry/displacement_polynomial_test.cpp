// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/displacement_polynomial.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/geometry/distortion.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

// Of degree 9, some tens of pixels at the rim, as image intensifiers have.
DetectorDistortion smoothDistortion(double scale_px = 8) {
  test::Random random(5);
  DisplacementPolynomial shift{9, Eigen::Matrix2Xd(2, DisplacementPolynomial::termCount(9))};
  for (Eigen::Index k = 0, degree = 0; k < shift.coefficients_px.cols(); ++k) {
    if (k >= DisplacementPolynomial::termCount(static_cast<int>(degree))) ++degree;
    const double y = random.normal(), x = random.normal();
    shift.coefficients_px.col(k) = scale_px / (1 + degree * degree) * Eigen::Vector2d(x, y);
  }
  return DetectorDistortion::polynomial({500, 520}, 600, shift);
}

TEST(DisplacementPolynomial, MapsBothWaysInsideAndBeyondTheCircle) {
  const DetectorDistortion distortion = smoothDistortion();
  distortion.check("camera", 1024, 1024);
  test::Random random(1);
  double most = 0;
  for (int i = 0; i < 400; ++i) {
    const double u = random.uniform(-100, 1124), v = random.uniform(-100, 1124);
    const Eigen::Vector2d pinhole_px(u, v), image_px = distortion.distorted(pinhole_px);
    const auto back = distortion.undistorted(image_px);
    ASSERT_TRUE(back);
    EXPECT_LT((*back - pinhole_px).norm(), 1e-8);
    most = std::max(most, (image_px - pinhole_px).norm());
  }
  EXPECT_GT(most, 10);  // It is no identity.
}

TEST(DisplacementPolynomial, JacobianIsThatOfDifferencesAlsoAcrossTheRim) {
  const DetectorDistortion distortion = smoothDistortion();
  const auto map = [&](const Eigen::VectorXd& x) { return distortion.distorted(x); };
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(500, 520), Eigen::Vector2d(300, 700), Eigen::Vector2d(1000, 1000),
                                    Eigen::Vector2d(-80, 1100), Eigen::Vector2d(500, 520 + 599.9)}) {
    Eigen::Matrix2d J;
    distortion.distorted(px, &J);
    // h^2 f''' of a polynomial of degree 9 over 600 px is below 1e-8 at a step of 0.01 px.
    EXPECT_LT((J - test::centralDifferences(map, px, 1e-2)).norm(), 1e-7) << px.transpose();
  }
  // Value and derivative go on over the rim: 2 um to both sides of it they differ by what the slope makes of it.
  const Eigen::Vector2d out = Eigen::Vector2d(0.6, 0.8), rim = Eigen::Vector2d(500, 520) + 600 * out;
  Eigen::Matrix2d J_in, J_out;
  const Eigen::Vector2d in_px = distortion.distorted(rim - 1e-6 * out, &J_in),
                        out_px = distortion.distorted(rim + 1e-6 * out, &J_out);
  EXPECT_LT((in_px - out_px).norm(), 1e-5);
  EXPECT_LT((J_in - J_out).norm(), 1e-6);
}

TEST(DisplacementPolynomial, TermsAreTheRowsOfAFit) {
  const DetectorDistortion distortion = smoothDistortion();
  const Eigen::Vector2d p(0.3, -0.7);
  const Eigen::Vector2d by_terms = distortion.shift.coefficients_px * DisplacementPolynomial::terms(9, p);
  EXPECT_LT((by_terms - distortion.shift.at(p)).norm(), 1e-12);
  // P_2(x) = (3 x^2 - 1) / 2 is the fourth term, after 1, x and y.
  EXPECT_NEAR(DisplacementPolynomial::terms(2, p)[3], 0.5 * (3 * 0.09 - 1), 1e-15);
}

TEST(DisplacementPolynomial, OneThatFoldsOrIsNotWholeIsRefused) {
  const DetectorDistortion folded = smoothDistortion(2000);
  EXPECT_NE(test::refusalOf([&] { folded.check("camera.yaml", 1024, 1024); }).find("one-to-one"), std::string::npos);
  DetectorDistortion short_one = smoothDistortion();
  short_one.shift.coefficients_px.conservativeResize(2, 54);
  EXPECT_NE(test::refusalOf([&] { short_one.check("camera.yaml", 1024, 1024); }).find("must be 55 numbers"),
            std::string::npos);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/test/namespace.hpp"
#include "fit_classification.hpp"

#include <gtest/gtest.h>

#include "angio/geometry/decompositions.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

const Eigen::Vector3d kCentroid(0.03, -0.12,
                                0.2);  // Far off the origin, as in a scanner's frame: lever arms must show.

Pose somePose(test::Random& random) {
  Pose T = expSE3(random.twist(0.1, 1));
  T.translation().z() += 0.75;
  return T;
}

// T Trans(c) exp(xi) Trans(-c), PosePrior's own words.
Pose about(const Pose& T, const Twist& xi) {
  const Eigen::Translation3d to_centroid(kCentroid);
  return T * to_centroid * expSE3(xi) * to_centroid.inverse();
}

// A covariance with millimetres and degrees in every direction, and correlations among them.
Matrix6d someCovariance(test::Random& random, double translation_m, double rotation_rad) {
  Matrix6d A;
  for (int k = 0; k < 6; ++k) A.col(k) = random.twist(translation_m, rotation_rad);
  return A * A.transpose() / 6;
}

Vector6d drawTwist(test::Random& random, const Matrix6d& covariance) {
  return lowerFactorOf(covariance) * random.twist(1, 1);
}

double normalized(const Twist& xi, const Matrix6d& covariance) { return squaredMahalanobis(xi, covariance); }

TEST(PoseCovariance, GoesFromOneMeaningToTheOtherAndBack) {
  test::Random random(1);
  const Pose T = somePose(random);
  const Matrix6d about_centroid = someCovariance(random, 2e-4, 1e-3);
  const Matrix6d of_result = covarianceOfResult(about_centroid, T, kCentroid);
  // Draw by the one definition, read off by the other: (t, rotation in camera axes), R_true = exp(dw) R, t_true = t +
  // dt.
  const int draws = 4000;
  double sum = 0;
  Matrix6d scatter = Matrix6d::Zero();
  for (int i = 0; i < draws; ++i) {
    const Pose drawn = about(T, drawTwist(random, about_centroid));
    Vector6d e;
    e << drawn.translation() - T.translation(), logSO3(drawn.linear() * T.linear().transpose());
    sum += normalized(e, of_result);
    scatter += e * e.transpose() / draws;
  }
  // Chi-square with six degrees of freedom: a standard deviation of sqrt(12), over sqrt(4000); four of them.
  EXPECT_NEAR(sum / draws, 6, 0.22);
  // The mean above holds the trace only. Whitened, the scatter is the identity up to sqrt(2/n) = 0.022 an entry; five.
  const Matrix6d L_inverse = inverseOf(lowerFactorOf(of_result));
  EXPECT_LT((L_inverse * scatter * L_inverse.transpose() - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 0.11);

  const Matrix6d back = covarianceAboutCentroid(of_result, T, kCentroid);
  EXPECT_LT((back - about_centroid).norm(), 1e-12 * about_centroid.norm());
}

}  // namespace
}  // namespace angio::test

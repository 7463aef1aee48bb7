// SPDX-License-Identifier: GPL-2.0-or-later
#include "place_correlation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace angio::registration {
namespace {

// Of counts that fill no vector, and places that are the same.
TEST(PlaceCorrelation, IsTheFormulaInDoublePrecision) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> coordinate_m(-0.2, 0.2);
  Eigen::Matrix3Xd a(3, 37), b(3, 21);
  for (auto* places : {&a, &b}) {
    for (double& value : places->reshaped()) value = coordinate_m(random);
  }
  b.col(20) = a.col(36);
  b.col(19) = a.col(0) + Eigen::Vector3d(1e-4, 0, 0);
  const std::vector<CorrelationPart> parts = {{0.7, 60e-3, true}, {0.3, 10e-3, true}, {0.015, 20e-3, false}};
  const Eigen::MatrixXf result = placeCorrelation(parts, a, b);
  ASSERT_EQ(result.rows(), a.cols());
  ASSERT_EQ(result.cols(), b.cols());
  for (Eigen::Index i = 0; i < a.cols(); ++i) {
    for (Eigen::Index j = 0; j < b.cols(); ++j) {
      const double apart_m = (a.col(i) - b.col(j)).norm(), s = apart_m / 60e-3, t = apart_m / 10e-3;
      const double expected = 0.7 * (1 + s + s * s / 3) * std::exp(-s) + 0.3 * (1 + t + t * t / 3) * std::exp(-t) +
                              0.015 * std::exp(-apart_m / 20e-3);
      EXPECT_NEAR(result(i, j), expected, 1e-6) << i << ' ' << j;
    }
  }
}

}  // namespace
}  // namespace angio::registration

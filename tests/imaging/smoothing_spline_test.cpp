// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing_spline.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace angio::test {
namespace {

constexpr std::size_t kPoints = 40;

// Sums of ten or so doubles of the order of one, through a system with a condition number below 1e6.
constexpr double kRounding = 1e-8;

// The same least squares with all its rows written out.
TEST(SmoothingSpline, IsTheLeastSquaresSolution) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> part(0.1, 1);
  for (const std::size_t count : {1UL, 2UL, 3UL, 4UL, kPoints}) {
    SmoothingSpline spline(count);
    const auto n = static_cast<Eigen::Index>(count);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2 * n, n);
    Eigen::VectorXd y = Eigen::VectorXd::Zero(2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double value = part(random), weight = part(random);
      spline.measure(static_cast<std::size_t>(i), value, weight);
      J(i, i) = std::sqrt(weight);
      y[i] = std::sqrt(weight) * value;
      if (i == 0 || i + 1 == n) continue;
      const double bend = part(random), stiffness = 30 * part(random);
      spline.stiffen(static_cast<std::size_t>(i), bend, stiffness);
      J.block<1, 3>(n + i, i - 1) = std::sqrt(stiffness) * Eigen::RowVector3d(1, -2, 1);
      y[n + i] = -std::sqrt(stiffness) * bend;
    }
    const Eigen::VectorXd expected = J.colPivHouseholderQr().solve(y);
    const std::vector<double> found = spline.solve();
    for (Eigen::Index i = 0; i < n; ++i) EXPECT_NEAR(found[static_cast<std::size_t>(i)], expected[i], kRounding) << i;
  }
}

// What lies on a line without a bend costs nothing, and where next to nothing is known the way goes straight on.
TEST(SmoothingSpline, GoesStraightOnWhereNothingIsMeasured) {
  SmoothingSpline spline(kPoints);
  const auto line = [](std::size_t i) { return 3 - 0.25 * static_cast<double>(i); };
  for (std::size_t i = 0; i < kPoints; ++i) {
    const bool hidden = (i > 10 && i < 22) || i > 34;
    if (hidden) {
      spline.measure(i, 100, 1e-12);
    } else {
      spline.measure(i, line(i), 1);
    }
    if (i > 0 && i + 1 < kPoints) spline.stiffen(i, 0, 20);
  }
  const std::vector<double> found = spline.solve();
  for (std::size_t i = 0; i < kPoints; ++i) EXPECT_NEAR(found[i], line(i), 1e-6) << i;
}

// An arc that nothing was measured of becomes the chord between its ends.
TEST(SmoothingSpline, TakesOutBendsThatNothingSpeaksFor) {
  SmoothingSpline spline(kPoints);
  const auto arc = [](std::size_t i) {
    return 0.02 * static_cast<double>(i) * (static_cast<double>(i) - (kPoints - 1));
  };
  for (std::size_t i = 0; i < kPoints; ++i) {
    spline.measure(i, 0, i == 0 || i + 1 == kPoints ? 1e3 : 1e-9);
    if (i > 0 && i + 1 < kPoints) spline.stiffen(i, arc(i - 1) - 2 * arc(i) + arc(i + 1), 20);
  }
  const std::vector<double> found = spline.solve();
  for (std::size_t i = 0; i < kPoints; ++i) EXPECT_NEAR(found[i] + arc(i), 0, 1e-5) << i;
}

}  // namespace
}  // namespace angio::test

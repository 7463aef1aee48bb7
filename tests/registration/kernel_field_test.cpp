// SPDX-License-Identifier: GPL-2.0-or-later
#include "kernel_field.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/random.hpp"
#include "oriented_frame.hpp"

namespace angio::test {
namespace {

OrientedPoints randomOrientedPoints(unsigned seed, int count) {
  test::Random random(seed);
  OrientedPoints points;
  for (int j = 0; j < count; ++j) {
    const auto u = static_cast<float>(random.uniform(-20, 320)), v = static_cast<float>(random.uniform(-20, 220));
    const double phi = random.uniform(-kPi, kPi);
    const auto mass = static_cast<float>(random.uniform(0.5, 4));
    points.add(u, v, static_cast<float>(std::cos(2 * phi)), static_cast<float>(std::sin(2 * phi)), mass);
  }
  return points;
}

// The sum as its definition says, pair by pair.
double bruteForce(const OrientedPoints& points, const Eigen::Vector2d& at, double phi, double scale) {
  double sum = 0;
  for (int j = 0; j < points.size(); ++j) {
    const double distance2 = (at - Eigen::Vector2d(points.u[j], points.v[j])).squaredNorm();
    const double cos_squared = 0.5 * (1 + std::cos(2 * phi) * points.cos2[j] + std::sin(2 * phi) * points.sin2[j]);
    sum += points.mass_px[j] * std::exp(-distance2 / (2 * scale * scale)) * cos_squared;
  }
  return sum / (scale * std::sqrt(2 * kPi));
}

TEST(KernelField, IsTheSumOverAllPairs) {
  const OrientedPoints points = randomOrientedPoints(1, 300);
  test::Random random(2);
  for (const double scale : {32.0, 16.0, 8.0}) {
    KernelField field;
    field.build(points, scale, KernelField::Region::detector(300, 200));
    double largest = 0, worst = 0, at_cells = 0;
    for (int i = 0; i < 500; ++i) {
      const double u = random.uniform(0, 299), v = random.uniform(0, 199), phi = random.uniform(-kPi, kPi);
      const double expected = bruteForce(points, {u, v}, phi, scale);
      largest = std::max(largest, expected);
      worst = std::max(worst, std::abs(field.at({u, v}, std::cos(2 * phi), std::sin(2 * phi)).F - expected));
      // On a cell's centre nothing is interpolated: what is left is the kernels' end at three scales, 1 % of a kernel
      // each.
      const Eigen::Vector2d center(field.u_origin_px() + field.cell_px() * (2 + i % 8),
                                   field.v_origin_px() + field.cell_px() * (2 + i % 5));
      at_cells = std::max(at_cells, std::abs(field.at(center, std::cos(2 * phi), std::sin(2 * phi)).F -
                                             bruteForce(points, center, phi, scale)));
    }
    EXPECT_LT(at_cells, 0.02 * largest) << scale;
    // Between them bilinear interpolation of a Gaussian on cells of half its width: h^2 / 8 of its second derivative,
    // twice.
    EXPECT_LT(worst, 0.08 * largest) << scale;
  }
}

TEST(KernelField, GradientIsThatOfTheValueItReads) {
  const OrientedPoints points = randomOrientedPoints(3, 200);
  KernelField field;
  field.build(points, 16, KernelField::Region::detector(300, 200));
  test::Random random(4);
  for (int i = 0; i < 200; ++i) {
    // Inside a cell, where the interpolation is smooth.
    const double u = field.u_origin_px() + field.cell_px() * (3 + i % 20 + random.uniform(0.1, 0.9));
    const double v = field.v_origin_px() + field.cell_px() * (3 + i % 13 + random.uniform(0.1, 0.9));
    const double c = std::cos(0.1 * i), s = std::sin(0.1 * i), h = 1e-2;
    const auto F = [&](double x, double y) { return field.at({x, y}, c, s).F; };
    const Eigen::Vector2d numeric((F(u + h, v) - F(u - h, v)) / (2 * h), (F(u, v + h) - F(u, v - h)) / (2 * h));
    EXPECT_LT((numeric - field.at({u, v}, c, s).gradient).norm(), 1e-5);  // Single precision over 2 h.
  }
}

// What the kernel's normalisation is for: weights mean the same at every scale and for every sampling.
TEST(KernelField, IsOneOnASingleStraightVesselAtEveryScaleAndSpacing) {
  for (const double spacing : {1.0, 2.0, 5.0}) {
    Eigen::Matrix2Xd line(2, static_cast<int>(900 / spacing));
    for (int j = 0; j < line.cols(); ++j)
      line.col(j) << 50 + spacing * j * std::cos(0.4), 60 + spacing * j * std::sin(0.4);
    OrientedPoints points;
    orientedPoints(makeCenterline(line, std::vector<int>(static_cast<std::size_t>(line.cols()), 0)), 2, 10000, points);
    for (const double scale : {32.0, 16.0, 8.0}) {
      KernelField field;
      field.build(points, scale, KernelField::Region::detector(1024, 512));
      const Eigen::Vector2d middle = line.col(line.cols() / 2);
      EXPECT_NEAR(field.at(middle, std::cos(0.8), std::sin(0.8)).F, 1, 0.05);
      EXPECT_NEAR(field.at(middle, -std::cos(0.8), -std::sin(0.8)).F, 0, 0.02) << "a vessel across it does not count";
    }
  }
}

TEST(OrientedPoints, CarryTheLengthOfTheirLineWhateverItsSampling) {
  Eigen::Matrix2Xd sparse(2, 11), dense(2, 1001);
  for (int j = 0; j < 11; ++j) sparse.col(j) << 50.0 * j, 20;
  for (int j = 0; j < 1001; ++j) dense.col(j) << 0.5 * j, 20;
  for (const auto& line : {sparse, dense}) {
    OrientedPoints points, fewer;
    orientedPoints(makeCenterline(line, std::vector<int>(static_cast<std::size_t>(line.cols()), 0)), 2, 10000, points);
    thinned(points, 7, fewer);
    for (const auto* some : {&points, &fewer}) {
      double length = 0;
      for (const float mass : some->mass_px) length += mass;
      EXPECT_NEAR(length, 500, 1e-2);
    }
  }
}

TEST(OrientedPoints, OfUnorderedPointsAreWeighedByHowDenseTheyAre) {
  // A skeleton's pixels, and the same line with every second pixel: as much line.
  for (const int step : {1, 2}) {
    Eigen::Matrix2Xd line(2, 400 / step);
    for (int j = 0; j < line.cols(); ++j) line.col(j) << 60.0 + step * j, 100;
    OrientedPoints points;
    orientedPoints(makeCenterline(line), 2, 10000, points);
    double length = 0;
    for (const float mass : points.mass_px) length += mass;
    EXPECT_NEAR(length, 400, 12);  // The line's ends, where half of the kernel has nothing under it.
  }
}

// Noise of 1 px makes a line of points 1.5 px apart longer by a third, and its chords by a hundredth. Two
// lines are two lengths: no chord leads from one to the other.
TEST(OrientedFrame, ChordsAreNoLongerForNoise) {
  test::Random random(3);
  Eigen::Matrix2Xd points(2, 800);
  std::vector<int> branch;
  for (int j = 0; j < points.cols(); ++j) {
    points.col(j) << 100 + 1.5 * (j % 400) + random.normal(), (j < 400 ? 200 : 500) + random.normal();
    branch.push_back(j / 400);
  }
  const XrayCamera camera = clinicalCamera();
  const Centerline2d both = makeCenterline(points, branch),
                     one = makeCenterline(points.leftCols(400), std::vector<int>(400, 0));
  const XrayViews views{{both, camera}}, first{{one, camera}};
  OrientedFrame frame;
  frame.begin(views, {});
  EXPECT_GT(frame.length_px(), 1.2 * 1200);
  EXPECT_NEAR(frame.chordLength_px(), 1200, 24);
  // Found anew for another frame.
  frame.begin(first, {});
  EXPECT_NEAR(frame.chordLength_px(), 600, 12);
}

TEST(KernelField, PointsFarAwayAndFieldsOfOnePixelAreNoHarm) {
  OrientedPoints points;
  points.add(1e30f, -1e30f, 1, 0, 1);
  points.add(-5000, 70000, 1, 0, 1);
  points.add(0, 0, 1, 0, 1);
  KernelField field;
  field.build(points, 8, KernelField::Region::detector(1, 1));
  EXPECT_NEAR(field.at({0, 0}, 1, 0).F, 1 / (8 * std::sqrt(2 * kPi)), 0.003);
  EXPECT_EQ(field.at({1e6, 0}, 1, 0).F, 0);
}

}  // namespace
}  // namespace angio::test

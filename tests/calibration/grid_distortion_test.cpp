// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/grid_distortion.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "angio/test/errors.hpp"
#include "angio/test/shared_data.hpp"
#include "grid_scenes.hpp"

namespace angio::test {
namespace {

constexpr int kSide = 512;

// Pincushion of 6 per cent and an S of 3 degrees: 20 px at the rim.
DetectorDistortion trueDistortion() {
  const XrayCamera camera = XrayCamera::centered(kSide, kSide, 0.4e-3, 1.1);
  return DetectorDistortion::intensifier(camera, {0.06, 0, degToRad(3), 0});
}

// Every hole is where the plate and the distortion put it, with its own number.
TEST(HoleGrid, EveryHoleIsFoundAndNumbered) {
  test::Random random(1);
  const HolePlate plate;
  const DetectorDistortion truth = trueDistortion();
  const HoleGrid grid = findHoleGrid("grid.png", plateImage(plate, truth, kSide, random));
  int should_be = 0;
  for (int i = -40; i <= 40; ++i) {
    for (int j = -40; j <= 40; ++j) {
      const Eigen::Vector2d px = truth.distorted(plate.hole({i, j}));
      const Eigen::Vector2d middle = Eigen::Vector2d::Constant(0.5 * (kSide - 1));
      should_be += px.minCoeff() > 8 && px.maxCoeff() < kSide - 9 && (px - middle).norm() < 0.54 * kSide;
    }
  }
  EXPECT_GE(static_cast<int>(grid.holes.size()), should_be * 98 / 100);
  // The hole in the middle is (0, 0) here and some hole of the plate; the directions may be any two that are 60 deg
  // apart.
  const auto nearest = [&](const Eigen::Vector2d& px) {
    const Eigen::Vector2d at = plate.steps().inverse() * (*truth.undistorted(px) - plate.origin_px);
    return Eigen::Vector2i(std::lround(at.x()), std::lround(at.y()));
  };
  std::vector<Eigen::Vector2i> found(3);
  for (const GridHole& hole : grid.holes) {
    if (hole.index == Eigen::Vector2i(0, 0)) found[0] = nearest(hole.center_px);
    if (hole.index == Eigen::Vector2i(1, 0)) found[1] = nearest(hole.center_px);
    if (hole.index == Eigen::Vector2i(0, 1)) found[2] = nearest(hole.center_px);
  }
  double squared = 0;
  int whole = 0;
  for (const GridHole& hole : grid.holes) {
    const Eigen::Vector2i number =
        found[0] + hole.index.x() * (found[1] - found[0]) + hole.index.y() * (found[2] - found[0]);
    const double off_px = (truth.distorted(plate.hole(number)) - hole.center_px).norm();
    EXPECT_LT(off_px, 0.45 * plate.pitch_px);  // Half a pitch is another hole; the rim cuts some.
    if (!hole.whole) continue;
    squared += off_px * off_px;
    ++whole;
  }
  EXPECT_GT(whole, 800);
  EXPECT_LT(std::sqrt(squared / whole), 0.1);  // Noise of 1 % leaves some hundredths of a pixel.
}

TEST(GridDistortion, IsTheTrueOneUpToASimilarity) {
  test::Random random(2);
  const HolePlate plate;
  const DetectorDistortion truth = trueDistortion();
  const HoleGrid grid = findHoleGrid("grid.png", plateImage(plate, truth, kSide, random));
  const GridDistortion fit = fitGridDistortion("grid.png", grid);
  EXPECT_LT(fit.held_out_rms_px, 0.1);
  EXPECT_GE(fit.order, 3);
  EXPECT_GT(fit.displacement_max_px, 4);
  // Straight lines of the pinhole image are straight in the other: a similarity of 4 numbers maps one onto the other.
  std::vector<Eigen::Vector2d> seen_px;
  for (int k = 0; k < 81; ++k) {
    const Eigen::Vector2d px(60 + 49.0 * (k % 9), 60 + 49.0 * (k / 9));
    if ((px - Eigen::Vector2d(255.5, 255.5)).norm() < 0.45 * kSide) seen_px.push_back(px);
  }
  const auto count = static_cast<Eigen::Index>(seen_px.size());
  Eigen::MatrixXd A(2 * count, 4);
  Eigen::VectorXd b(2 * count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Vector2d& px = seen_px[static_cast<std::size_t>(k)];
    const Eigen::Vector2d p = *truth.undistorted(px), q = *fit.distortion.undistorted(px);
    A.row(2 * k) << p.x(), -p.y(), 1, 0;
    A.row(2 * k + 1) << p.y(), p.x(), 0, 1;
    b.segment<2>(2 * k) = q;
  }
  const Eigen::VectorXd off = A * (A.transpose() * A).inverse() * (A.transpose() * b) - b;
  EXPECT_LT(std::sqrt(off.squaredNorm() / static_cast<double>(count)), 0.05);
  // The claim: of the map's standard deviation per axis, and of a hole's.
  EXPECT_LT(fit.std_px({256, 256}), 0.02);
  EXPECT_GT(fit.std_px({256, 256}), 1e-4);
}

TEST(HoleGrid, OtherPicturesAreRefusedByName) {
  test::Random random(3);
  cv::Mat noise(256, 256, CV_8U);
  for (int i = 0; i < 256 * 256; ++i)
    noise.at<unsigned char>(i / 256, i % 256) = cv::saturate_cast<uchar>(100 + 9 * random.normal());
  EXPECT_NE(test::refusalOf([&] { findHoleGrid("noise.png", noise); }).find("noise.png: grid"), std::string::npos);
  HolePlate square;
  square.columns_rad = kPi / 2;
  const cv::Mat image = plateImage(square, trueDistortion(), kSide, random);
  EXPECT_NE(test::refusalOf([&] { findHoleGrid("square.png", image); }).find("square.png: holes"), std::string::npos);
  EXPECT_GT(findHoleGrid("square.png", image, GridShape::kSquare).holes.size(), 700u);
}

// 4,945 and 4,700 holes were counted by hand; 95 % of them are the bound.
TEST(GridDistortion, RealIntensifiersFitToAQuarterOfAPixel) {
  NEED_SHARED_DATA("guide3d-calibration/grid_16709.jpg");
  for (const auto& [name, counted] : {std::pair("16709", 4945), std::pair("16710", 4700)}) {
    const std::string path = sharedData(std::string("guide3d-calibration/grid_") + name + ".jpg");
    const GridDistortion fit = fitGridDistortion(path, findHoleGrid(path, cv::imread(path, cv::IMREAD_UNCHANGED)));
    EXPECT_GT(fit.found, 0.95 * counted) << name;
    EXPECT_LT(fit.found, 1.02 * counted) << name;
    EXPECT_LT(fit.held_out_rms_px, 0.25) << name;
    // The order matters: one of 4 is not enough.
    EXPECT_LT(fit.held_out_rms_px, 0.5 * fit.choice_rms_px[3]) << name;
    const auto back = fit.distortion.undistorted(fit.distortion.distorted({100, 900}));
    ASSERT_TRUE(back);
    EXPECT_LT((*back - Eigen::Vector2d(100, 900)).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/distortion.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/differences.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

XrayCamera camera() { return XrayCamera({1024, 900, 4000, 4010, 520, 440, {}, {}}); }

// None; an intensifier at its worst; a lens as Zhang's, wider than any X-ray cone.
std::vector<DetectorDistortion> distortions() {
  const XrayCamera lens({640, 480, 832.5, 832.53, 303.959, 206.585, {}, {}});
  return {DetectorDistortion::radial(camera(), 0, 0), DetectorDistortion::radial(lens, -0.228601, 0.190353, 0.204494),
          DetectorDistortion::intensifier(camera(), {0.08, -0.01, degToRad(5), degToRad(-1)})};
}

TEST(DetectorDistortion, UndoesItself) {
  test::Random random(1);
  for (const auto& distortion : distortions()) {
    for (int i = 0; i < 200; ++i) {
      const double u = random.uniform(-100, 1124), v = random.uniform(-100, 1000);
      const Eigen::Vector2d pinhole_px(u, v);
      const auto back = distortion.undistorted(distortion.distorted(pinhole_px));
      ASSERT_TRUE(back);
      EXPECT_LT((*back - pinhole_px).norm(), 1e-9);
    }
    // The centre stays where it is.
    EXPECT_EQ(distortion.distorted(distortion.center_px), distortion.center_px);
    EXPECT_EQ(distortion.undistorted(distortion.center_px), distortion.center_px);
  }
}

TEST(DetectorDistortion, JacobiansAreThoseOfDifferences) {
  test::Random random(2);
  for (const auto& distortion : distortions()) {
    for (int i = 0; i < 20; ++i) {
      const double u = random.uniform(0, 640), v = random.uniform(0, 480);
      const Eigen::Vector2d px(u, v);
      Eigen::Matrix2d J, J_back;
      distortion.distorted(px, &J);
      distortion.undistorted(px, &J_back);
      // h^2 f''' is below 1e-9 at a step of 0.01 px, and rounding 1e-13 * 1000 / 0.01.
      EXPECT_LT(
          (J - test::centralDifferences([&](const Eigen::VectorXd& x) { return distortion.distorted(x); }, px, 1e-2))
              .norm(),
          1e-8);
      EXPECT_LT((J_back - test::centralDifferences([&](const Eigen::VectorXd& x) { return *distortion.undistorted(x); },
                                                   px, 1e-2))
                    .norm(),
                1e-8);
    }
  }
}

TEST(RadialBend, CoefficientsHaveTheirDerivatives) {
  const Eigen::Vector2d p(0.7, -0.4);
  const Eigen::Vector4d at(0.08, -0.01, 0.1, -0.02);
  const auto bent = [&](const Eigen::VectorXd& b) { return RadialBend{b[0], b[1], b[2], b[3]}.bent(p); };
  Eigen::Matrix<double, 2, 4> J;
  RadialBend{at[0], at[1], at[2], at[3]}.bent(p, nullptr, &J);
  EXPECT_LT((J - test::centralDifferences(bent, at, 1e-4)).norm(), 1e-9);
}

TEST(DetectorDistortion, OneThatFoldsTheDetectorIsRefused) {
  // It turns over where 1 - 120 r^2 = 0: 365 px from the middle at a focal length of 4000.
  const auto folded = DetectorDistortion::radial(camera(), -40, 0);
  EXPECT_FALSE(folded.undistorted({1023, 0}));
  const std::string line = test::refusalOf([&] { folded.check("camera.yaml", 1024, 900); });
  EXPECT_NE(line.find("camera.yaml: distortion"), std::string::npos) << line;
  EXPECT_NE(line.find("one-to-one"), std::string::npos) << line;
  for (const auto& good : distortions()) good.check("camera.yaml", 640, 480);
}

}  // namespace
}  // namespace angio::test

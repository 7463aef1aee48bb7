// SPDX-License-Identifier: GPL-2.0-or-later
#include "lone_catheter.hpp"

#include <gtest/gtest.h>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

// Straight lines as an extractor says them.
class Lines {
 public:
  Lines& add(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double contrast, double radius_px) {
    const int count = static_cast<int>((to - from).norm() / 2);
    for (int k = 0; k <= count; ++k) {
      points_.push_back(from + (to - from) * k / count);
      branch_.push_back(lines_);
      contrast_.push_back(contrast);
      radius_px_.push_back(radius_px);
    }
    ++lines_;
    return *this;
  }
  Centerline2d seen() const {
    Eigen::Matrix2Xd points(2, points_.size());
    for (std::size_t k = 0; k < points_.size(); ++k) points.col(static_cast<Eigen::Index>(k)) = points_[k];
    Centerline2d seen = makeCenterline(points, branch_, vectorOf(radius_px_));
    seen.contrast = vectorOf(contrast_);
    return seen;
  }

 private:
  static Eigen::VectorXd vectorOf(const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  std::vector<Eigen::Vector2d> points_;
  std::vector<int> branch_;
  std::vector<double> contrast_, radius_px_;
  int lines_ = 0;
};

// A catheter of 400 px from the image's border, of 5 px radius.
Lines catheter() { return Lines().add({500, 5}, {500, 405}, 0.2, 5); }

const XrayCamera& camera() {
  static const XrayCamera camera = test::clinicalCamera();
  return camera;
}

TEST(LoneCatheter, IsTheOnlyCurve) {
  const auto lone = loneCatheter(catheter().seen(), camera());
  ASSERT_TRUE(lone);
  EXPECT_EQ(lone->curve.size(), catheter().seen().size());
  EXPECT_EQ(lone->seen.tip_end, TipEnd::kLast);
  EXPECT_EQ(lone->seen.points_px.rightCols<1>(), Eigen::Vector2d(500, 405));
}

TEST(LoneCatheter, StandsBeforeAFaintBackground) {
  const Centerline2d seen =
      catheter().add({100, 700}, {400, 700}, 0.07, 3.3).add({700, 700}, {900, 800}, 0.1, 4).seen();
  const auto lone = loneCatheter(seen, camera());
  ASSERT_TRUE(lone);
  EXPECT_EQ(lone->curve.size(), catheter().seen().size());
}

// What is as dark as it may be a second one, or a vessel; and where nothing is known of that, any line may.
TEST(LoneCatheter, IsNoneOfTwoDarkLines) {
  EXPECT_FALSE(loneCatheter(catheter().add({100, 700}, {400, 700}, 0.15, 5).seen(), camera()));
  Centerline2d unknown = catheter().add({100, 700}, {400, 700}, 0.07, 3.3).seen();
  unknown.contrast.resize(0);
  EXPECT_FALSE(loneCatheter(unknown, camera()));
}

// A trunk with a thin branch is a vessel.
TEST(LoneCatheter, HasNoBranches) {
  EXPECT_FALSE(loneCatheter(catheter().add({506, 300}, {700, 350}, 0.05, 2).seen(), camera()));
}

TEST(LoneCatheter, IsNotTheLongestOfManyLines) {
  Lines lines = catheter();
  for (int k = 0; k < 6; ++k) lines.add({600, 100.0 + 100 * k}, {900, 100.0 + 100 * k}, 0.05, 3);
  EXPECT_FALSE(loneCatheter(lines.seen(), camera()));
}

TEST(LoneCatheter, IsNoneInAnEmptyImage) { EXPECT_FALSE(loneCatheter({}, camera())); }

}  // namespace
}  // namespace angio::test

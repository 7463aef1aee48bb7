// SPDX-License-Identifier: GPL-2.0-or-later
#include "explained_shares.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/registration/starts.hpp"
#include "angio/test/namespace.hpp"
#include "kernel_scene.hpp"

namespace angio::test {
namespace {

constexpr double kCell_px = 8;

// Under a pose a model's and an image's shares of each other.
double shares(const KernelScene& s, const Centerline2d& image, const Pose& T_camera_model) {
  const OrientedModel model(s.tree, {});
  const XrayViews views{{image, s.camera}};
  OrientedFrame frame;
  frame.begin(views, {});
  return ExplainedShares(model, frame, kCell_px).of(T_camera_model * Eigen::Translation3d(model.centroid));
}

// Short strokes across the lines: the places are right, and no direction is.
Centerline2d acrossThe(const Centerline2d& image) {
  constexpr int kEvery = 8;
  Eigen::Matrix2Xd points(2, 3 * (image.size() / kEvery));
  std::vector<int> branch;
  for (int k = 0; k < points.cols(); ++k) {
    const double along = image.tangent_rad[kEvery * (k / 3)];
    points.col(k) =
        image.points_px.col(kEvery * (k / 3)) + 4.0 * (k % 3 - 1) * Eigen::Vector2d(-std::sin(along), std::cos(along));
    branch.push_back(k / 3);
  }
  return makeCenterline(points, branch);
}

TEST(ExplainedShares, AreWholeAtTheTruthAndLittleElsewhere) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    const KernelScene s(seed);
    EXPECT_GT(shares(s, s.image, s.truth), 0.95);
    for (int i = 0; i < 8; ++i) {
      const Pose far = drawnPose(s.truth, s.tree.centroid(), degToRad(30), 30e-3, 4, i);
      EXPECT_LT(shares(s, s.image, far), 0.4) << seed << " " << i;
    }
  }
}

// Of a tree of which the image shows a part, the image is explained whole, and of the model that part.
TEST(ExplainedShares, OfAHalfEmptyTreeAreHalf) {
  const KernelScene s(1);
  std::vector<bool> keep(static_cast<std::size_t>(s.image.size()));
  for (int i = 0; i < s.image.size(); ++i) keep[static_cast<std::size_t>(i)] = s.image.branch[i] % 2 == 0;
  const Centerline2d half = pointsWhere(s.image, keep);
  const double filled = static_cast<double>(half.size()) / s.image.size();
  const double at_truth = shares(s, half, s.truth);
  EXPECT_GT(at_truth, filled - 0.1);
  EXPECT_LT(at_truth, filled + 0.25);  // Empty branches beside filled ones.
}

// What is left of the shares is by other vessels that cross there.
TEST(ExplainedShares, GoByDirections) {
  const KernelScene s(2);
  const Centerline2d across = acrossThe(s.image);
  EXPECT_LT(shares(s, across, s.truth), 0.3 * shares(s, s.image, s.truth));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// What the network of pairwise_dnn is shown, and what its six numbers mean.
#include <gmock/gmock.h>

#include <opencv2/core.hpp>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "image_gradient.hpp"
#include "image_pair.hpp"
#include "picture.hpp"

namespace angio::test {
namespace {

struct PairScene {
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  Pose truth;  // Of the centred tree.
  Centerline2d none;
  PairDrawing drawing;

  explicit PairScene(unsigned seed) : tree(test::branchingTree(seed)), drawing(tree, 0.6e-3) {
    test::Random random(seed + 40);
    truth = test::viewOf(tree, random) * Eigen::Translation3d(tree.centroid());
  }
  XrayView view() const { return {none, camera}; }
  PairWindow window(const Pose& T) const { return *PairWindow::about(drawing.pointsCentered(), view(), T); }
  cv::Mat attenuation() const {
    return vesselAttenuation(radiographOf(tree, camera, truth * Eigen::Translation3d(-tree.centroid())));
  }
};

// Correlation of two pictures.
double likeness(const cv::Mat& a, const cv::Mat& b) { return a.dot(b) / std::sqrt(a.dot(a) * b.dot(b)); }

TEST(PairMotion, LeadsBackToThePoseItWasTakenFrom) {
  const PairScene s(1);
  const PairWindow window = s.window(s.truth);
  test::Random random(5);
  for (int i = 0; i < 20; ++i) {
    const Pose to = s.truth * expSE3(random.twist(0.02, 0.2));
    const Pose back = movedInPair(window, s.truth, pairMotion(window, s.truth, to));
    EXPECT_LT((back.matrix() - to.matrix()).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// Each number is a pixel of the picture: measured on the projection of a point half a picture's side from the centroid,
// straight ahead, where perspective bends nothing.
TEST(PairMotion, CountsPixelsOfThePicture) {
  const PairScene s(2);
  Pose ahead = s.truth;
  ahead.translation() = Eigen::Vector3d(0, 0, 0.75);
  const PairWindow window = s.window(ahead);
  const double m_per_px = 0.75 / window.camera.parameters().fx_px;
  const Eigen::Vector3d edge(0.5 * kPairSide_px * m_per_px, 0, 0);
  const Eigen::Vector3d at = ahead.inverse() * (ahead.translation() + edge);  // In the centred tree's axes.
  const auto moves = [&](int number) {
    const Pose to = movedInPair(window, ahead, 0.01 * PairMotion::Unit(number));
    return Eigen::Vector2d((*window.camera.project(to * at) - *window.camera.project(ahead * at)) / 0.01);
  };
  EXPECT_LT((moves(0) - Eigen::Vector2d(1, 0)).norm(), 1e-3);
  EXPECT_LT((moves(1) - Eigen::Vector2d(0, 1)).norm(), 1e-3);
  EXPECT_LT((moves(2) - Eigen::Vector2d(-1, 0)).norm(), 1e-3) << "further off is smaller";
  EXPECT_LT((moves(5) - Eigen::Vector2d(0, 1)).norm(), 1e-3) << "x turns to y";
}

TEST(ImagePair, ShowsTheSameOnBothSidesAtTheTruthOnly) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    PairScene s(seed);
    const cv::Mat attenuation = s.attenuation();
    const auto likenessAt = [&](const Pose& T) {
      const ImagePair pair = s.drawing.pair(attenuation, s.view(), s.window(T), T);
      return likeness(pair.seen, pair.drawn);
    };
    EXPECT_GT(likenessAt(s.truth), 0.95) << seed;
    for (const int number : {0, 1, 3, 4, 5}) {
      EXPECT_LT(likenessAt(movedInPair(s.window(s.truth), s.truth, 4 * PairMotion::Unit(number))), 0.9) << number;
    }
  }
}

TEST(ImagePair, IsZeroWhereTheViewIsClosed) {
  PairScene s(3);
  XrayView view = s.view();
  view.collimator_px = {{0, 0}, {512, 0}, {512, 1023}, {0, 1023}};
  const PairWindow window = *PairWindow::about(s.drawing.pointsCentered(), view, s.truth);
  const ImagePair pair = s.drawing.pair(s.attenuation(), view, window, s.truth);
  const int first_closed = static_cast<int>((514.0 - window.rect.x) * kPairSide_px / window.rect.width) + 1;
  ASSERT_LT(first_closed, kPairSide_px);
  for (const cv::Mat& picture : {pair.seen, pair.drawn, pair.depth}) {
    EXPECT_EQ(cv::countNonZero(picture.colRange(first_closed, kPairSide_px)), 0);
    EXPECT_GT(cv::countNonZero(picture.colRange(0, first_closed)), 0);
  }
}

// Farther than the centroid is positive.
TEST(ImagePair, TellsNearFromFar) {
  PairScene s(4);
  const PairWindow window = s.window(s.truth);
  const ImagePair pair = s.drawing.pair(s.attenuation(), s.view(), window, s.truth);
  double agrees = 0;
  for (int i = 0; i < s.tree.size(); ++i) {
    const Eigen::Vector3d at = s.truth * s.drawing.pointsCentered().col(i);
    const Eigen::Vector2d pixel = *window.camera.project(at);
    const float depth = pair.depth.at<float>(cvRound(pixel.y()), cvRound(pixel.x()));
    agrees += (depth > 0) == (at.z() > s.truth.translation().z()) ? 1 : 0;
  }
  EXPECT_GT(agrees / s.tree.size(), 0.85) << "vessels that cross have one depth in the picture";
}

TEST(PairWindow, IsNothingWhereTheTreeIsNotSeen) {
  const PairScene s(5);
  for (const Eigen::Vector3d& off : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, -2)}) {
    Pose T = s.truth;
    T.translation() += off;
    EXPECT_FALSE(PairWindow::about(s.drawing.pointsCentered(), s.view(), T));
  }
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "line_step.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "field_step.hpp"
#include "oriented_frame.hpp"
#include "oriented_model.hpp"

namespace angio::test {
namespace {

struct LineScene {
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  OrientedModel model;
  Pose T;  // T_camera_centred
  OrientedPoints image;
  ProjectedEdges edges;

  explicit LineScene(unsigned seed) : tree(test::branchingTree(seed)), model(tree, {}) {
    test::Random random(seed + 40);
    const Pose truth = test::viewOf(tree, random);
    T = truth * Eigen::Translation3d(tree.centroid());
    orientedPoints(projectedCenterline(tree, camera, truth), 2, 10000, image);
    edges.project(model.points, model.edges, camera, T);
  }
};

TEST(ProjectedEdges, FindTheNearestEdgeThatRunsAlong) {
  const LineScene s(1);
  test::Random random(5);
  int found = 0;
  for (int i = 0; i < 3000; ++i) {
    // Around the vessels, and now and then anywhere.
    const auto j = static_cast<std::size_t>(random.uniform(0, s.image.size() - 1));
    const double spread = i % 10 == 0 ? 500 : 6;
    const auto u = static_cast<float>(s.image.u[j] + spread * random.normal());
    const auto v = static_cast<float>(s.image.v[j] + spread * random.normal());
    const double phi = random.uniform(-kPi, kPi), gate = i % 2 ? 40 : 5;
    const auto cos2 = static_cast<float>(std::cos(2 * phi)), sin2 = static_cast<float>(std::sin(2 * phi));
    const auto near = s.edges.nearest(u, v, cos2, sin2, static_cast<float>(gate), 0.5f);
    double best = gate;
    for (const auto& [parent, child] : s.model.edges) {
      const Eigen::Vector2d a = *s.camera.project(s.T * s.model.points.col(parent));
      const Eigen::Vector2d d = *s.camera.project(s.T * s.model.points.col(child)) - a, q(u, v);
      const double angle = std::atan2(d.y(), d.x());
      if (d.norm() < 0.05 || std::cos(2 * (angle - phi)) < 0.5) continue;
      const double along = std::clamp((q - a).dot(d) / d.squaredNorm(), 0.0, 1.0);
      best = std::min(best, (q - a - along * d).norm());
    }
    if (near.edge < 0) {
      EXPECT_GT(best, gate - 1e-3);
      continue;
    }
    ++found;
    EXPECT_NEAR(std::sqrt(near.distance2_px2), best, 1e-3);  // Single precision on a thousand pixels.
    EXPECT_NEAR(std::hypot(near.normal_u, near.normal_v), 1, 1e-4);
  }
  EXPECT_GT(found, 300);
}

// The residual of each match against its own numeric derivative, through the sums that the vector code makes.
TEST(LineEquations, GradientAndHessianAreThoseOfTheSum) {
  LineScene s(2);
  Twist by;
  by << 0.4e-3, -0.3e-3, 0.5e-3, 2e-3, -1e-3, 1.5e-3;
  const Pose T = s.T * expSE3(by);
  s.edges.project(s.model.points, s.model.edges, s.camera, T);
  LineMatches matches;
  matchLines(s.image, s.edges, 8, 0.5, matches);
  resolveMatches(s.model.points, s.model.edges, matches);
  ASSERT_GT(matches.matched, s.image.size() / 2);
  const double wide = 1e4;  // Weights of one: the sum is one of squares.
  const auto sumsAt = [&](const Pose& pose) {
    LineSums sums;
    addLineEquations(s.image, matches, s.camera, pose, wide, sums);
    return sums;
  };
  const LineSums sums = sumsAt(T);
  EXPECT_NEAR(sums.weight, matches.matched, 1e-3 * matches.matched);
  for (int k = 0; k < 6; ++k) {
    const double h = k < 3 ? 2e-5 : 4e-4;  // About a tenth of a pixel.
    Twist step = Twist::Zero();
    step[k] = h;
    const LineSums plus = sumsAt(T * expSE3(step)), minus = sumsAt(T * expSE3(-step));
    const double unit = k < 3 ? sums.g.head<3>().norm() : sums.g.tail<3>().norm();
    EXPECT_NEAR((plus.squares_px2 - minus.squares_px2) / (4 * h), sums.g[k], 1e-2 * unit) << k;  // Half the gradient.
    // Residuals are a tenth of what a Gauss-Newton Hessian leaves out here: a hundredth.
    EXPECT_NEAR((plus.g[k] - minus.g[k]) / (2 * h), sums.H(k, k), 0.02 * sums.H(k, k)) << k;
  }
}

TEST(LineEquations, AreTheSameOnEveryVectorTarget) {
  LineScene s(4);
  const Pose T = s.T * expSE3((Twist() << 0.3e-3, -0.2e-3, 0.4e-3, 1e-3, -1e-3, 2e-3).finished());
  s.edges.project(s.model.points, s.model.edges, s.camera, T);
  const auto sumsHere = [&] {
    LineMatches matches;
    matchLines(s.image, s.edges, 8, 0.5, matches);
    resolveMatches(s.model.points, s.model.edges, matches);
    LineSums sums;
    addLineEquations(s.image, matches, s.camera, T, 2, sums);
    return sums;
  };
  const LineSums widest = sumsHere();
  for (const auto target : fieldStepTargets()) {
    useFieldStepTarget(target);
    const LineSums sums = sumsHere();
    // Single precision, in another order; of two edges as near as each other another one may be taken.
    EXPECT_LT((sums.H - widest.H).norm(), 1e-3 * widest.H.norm());
    EXPECT_LT((sums.g - widest.g).norm(), 1e-3 * widest.g.norm());
    EXPECT_NEAR(sums.squares_px2, widest.squares_px2, 1e-3 * widest.squares_px2);
  }
  useFieldStepTarget(0);
}

TEST(LineEquations, NeighboursThatSayTheSameCountAsOne) {
  LineSums independent, together;
  test::Random random(3);
  std::vector<double> white, smooth;
  double state = 0;
  for (int j = 0; j < 4000; ++j) {
    const double z = random.normal();
    white.push_back(z);
    state = 0.9 * state + std::sqrt(1 - 0.81) * z;  // Autocorrelation 0.9^lag: 1 + 2 sum = 19.
    smooth.push_back(state);
  }
  const auto fill = [](const std::vector<double>& r, LineSums& sums) {
    for (const double x : r) sums.squares_px2 += x * x;
    for (int k = 0; k < LineSums::kLags; ++k) {
      for (std::size_t j = 0; j + (1u << k) < r.size(); ++j)
        sums.lagged_px2[static_cast<std::size_t>(k)] += r[j] * r[j + (1u << k)];
    }
  };
  fill(white, independent);
  fill(smooth, together);
  EXPECT_EQ(independent.togetherness(4000), 1);
  EXPECT_NEAR(together.togetherness(4000), 19, 6);  // From seven lags of one sample.
}

// An image line between two vessels that lie 6 px apart in projection: it is theirs together when it is wide enough to
// be both.
TEST(SoftenShared, PointsThatMayBeTwoVesselsCountLittle) {
  const XrayCamera camera = test::clinicalCamera();
  const double depth_m = 0.75, apart_m = 6 * depth_m / camera.parameters().fy_px;
  Eigen::Matrix3Xd points(3, 4);
  points << -0.03, 0.03, -0.03, 0.03, 0, 0, apart_m, apart_m, 0, 0, 0, 0;
  const std::vector<std::pair<int, int>> both = {{0, 1}, {2, 3}}, one = {{0, 1}};
  Pose T = Pose::Identity();
  T.translation().z() = depth_m;
  const auto lengthOfNormal = [&](const std::vector<std::pair<int, int>>& model_edges, float radius_px) {
    const Eigen::Vector2d on = *camera.project(Eigen::Vector3d(0, 0.5 * apart_m, depth_m));
    OrientedPoints image;
    image.begin.push_back(0);
    image.add(static_cast<float>(on.x()), static_cast<float>(on.y()), 1, 0, 2, 1, radius_px);
    image.pad();
    ProjectedEdges edges;
    edges.project(points, model_edges, camera, T);
    LineMatches matches;
    matchLines(image, edges, 8, 0.5, matches);
    softenShared(image, edges, 0.5, matches);
    return std::hypot(matches.of_point[0].normal_u, matches.of_point[0].normal_v);
  };
  EXPECT_LT(lengthOfNormal(both, 5), 0.5);
  EXPECT_FLOAT_EQ(lengthOfNormal(both, 1.5f), 1) << "two thin vessels so far apart are seen as two";
  EXPECT_FLOAT_EQ(lengthOfNormal(both, 0), 1) << "nothing is known of how wide it is";
  EXPECT_FLOAT_EQ(lengthOfNormal(one, 5), 1);
}

}  // namespace
}  // namespace angio::test

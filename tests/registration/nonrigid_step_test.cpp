// SPDX-License-Identifier: GPL-2.0-or-later
#include "nonrigid_step.hpp"

#include <ceres/autodiff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "biplane.hpp"
#include "ceres_costs.hpp"

namespace angio::test {
namespace {

// A small tree with one bifurcation, jittered so that no two distances are equal.
VesselTree smallTree(test::Random& random) {
  const int n = 24;
  Eigen::Matrix3Xd points(3, n);
  std::vector<int> parents(n);
  for (int i = 0; i < n; ++i) {
    parents[i] = i == 16 ? 7 : i - 1;
    const double side = i < 8 ? 0 : (i < 16 ? 1 : -1), along = i < 16 ? i : i - 8;
    points.col(i) = 1e-3 * Eigen::Vector3d(along, 0.6 * side * (along - 7), 0.3 * side) + random.vector(0.1e-3);
  }
  return VesselTree(points, parents);
}

struct PairWeight {
  int i, j;
  double weight;
};

// The sums of E_reg as the paper writes them, pair by ordered pair.
std::vector<PairWeight> paperPairs(const VesselTree& tree, const IterativePnpSettings& settings) {
  std::vector<PairWeight> pairs;
  for (int i = 0; i < tree.size(); ++i) {
    if (const int parent = tree.parents()[i]; parent >= 0) {
      pairs.push_back({i, parent, settings.w2});
      pairs.push_back({parent, i, settings.w2});
    }
    std::vector<int> order(tree.size());
    for (int j = 0; j < tree.size(); ++j) order[j] = j;
    const auto distance = [&](int j) { return (tree.points().col(j) - tree.points().col(i)).norm(); };
    std::sort(order.begin(), order.end(), [&](int a, int b) { return distance(a) < distance(b); });
    for (int k = 1; k <= settings.regulariser_neighbours; ++k) pairs.push_back({i, order[k], settings.w3});
  }
  return pairs;
}

// Seen from the front and from the side.
struct NonrigidScene {
  test::Random random{11};
  VesselTree tree = smallTree(random);
  XrayCamera camera = test::clinicalCamera();
  Pose T = test::viewOf(tree, random);
  Centerline2d none;
  XrayViews views{{none, camera}, {none, camera, test::fromTheSide()}};
  IterativePnpSettings settings;
  std::vector<Pull> pulls{2, Pull(tree.size())};

  NonrigidScene() {
    settings.lambda2 = 1.5;
    settings.regulariser_neighbours = 3;
    for (std::size_t v = 0; v < 2; ++v) {
      for (int i = 0; i < tree.size(); ++i) {
        pulls[v].weight[i] = i % 6 == 0 ? 0 : random.uniform(0.1, 1);
        const double x = 5 * random.normal(), y = 5 * random.normal();
        pulls[v].target_px.col(i) = pixel(v, tree.points().col(i)) + Eigen::Vector2d(x, y);
      }
    }
  }

  Pose T_view_model(std::size_t v) const { return views[v].T_view_first * T; }
  Eigen::Vector2d pixel(std::size_t v, const Eigen::Vector3d& p, Eigen::Matrix<double, 2, 3>* J = nullptr) const {
    return *camera.project(T_view_model(v) * p, J);
  }
};

TEST(NonrigidStep, SolvesTheDenseNormalEquations) {
  NonrigidScene s;
  const int n = s.tree.size();
  const Eigen::Matrix3Xd at = Eigen::Matrix3Xd::NullaryExpr(3, n, [&] { return 1e-3 * s.random.normal(); });
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(3 * n, 3 * n);  // [px^2 / mm^2]
  Eigen::VectorXd b = Eigen::VectorXd::Zero(3 * n);
  A.diagonal().setConstant(s.settings.lambda2 * s.settings.w1);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  for (const auto& [i, j, w] : paperPairs(s.tree, s.settings)) {
    A.block<3, 3>(3 * i, 3 * i) += s.settings.lambda2 * w * I;
    A.block<3, 3>(3 * j, 3 * j) += s.settings.lambda2 * w * I;
    A.block<3, 3>(3 * i, 3 * j) -= s.settings.lambda2 * w * I;
    A.block<3, 3>(3 * j, 3 * i) -= s.settings.lambda2 * w * I;
  }
  for (std::size_t v = 0; v < 2; ++v) {
    const Pull& pull = s.pulls[v];
    for (int i = 0; i < n; ++i) {
      Eigen::Matrix<double, 2, 3> J;
      const Eigen::Vector2d u = s.pixel(v, s.tree.points().col(i) + at.col(i), &J);
      J = J * s.T_view_model(v).linear() * 1e-3;
      A.block<3, 3>(3 * i, 3 * i) += pull.weight[i] * J.transpose() * J;
      b.segment<3>(3 * i) += pull.weight[i] * J.transpose() * (pull.target_px.col(i) - u + J * at.col(i) * 1e3);
    }
  }
  const Eigen::VectorXd dense = solveSymmetric(A, b);
  const auto solved = NonrigidStep(s.tree, s.settings).solve(s.views, s.T, s.pulls, at);
  ASSERT_TRUE(solved);
  // Millimetres; the system's condition number is near 1e4.
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(solved->data(), 3 * n) * 1e3 - dense).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_GT(dense.cwiseAbs().maxCoeff(), 0.1) << "nothing moved, nothing was tested";
}

struct Difference {
  double weight;
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    for (int k = 0; k < 3; ++k) residual[k] = std::sqrt(weight) * 1e3 * (a[k] - b[k]);
    return true;
  }
};

struct Size {
  double weight;
  template <typename T>
  bool operator()(const T* a, T* residual) const {
    for (int k = 0; k < 3; ++k) residual[k] = std::sqrt(weight) * 1e3 * a[k];
    return true;
  }
};

TEST(NonrigidStep, ComesToRestWhereCeresDoes) {
  NonrigidScene s;
  const int n = s.tree.size();
  Eigen::Matrix3Xd reference = Eigen::Matrix3Xd::Zero(3, n);
  Twist xi = Twist::Zero();
  ceres::Problem problem;
  for (int i = 0; i < n; ++i) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Size, 3, 3>(new Size{s.settings.lambda2 * s.settings.w1}),
                             nullptr, reference.col(i).data());
    for (std::size_t v = 0; v < 2; ++v) {
      const Pull& pull = s.pulls[v];
      if (pull.weight[i] == 0) continue;
      problem.AddResidualBlock(new ProjectionCost(s.camera, s.T_view_model(v), s.tree.points().col(i),
                                                  pull.target_px.col(i), pull.weight[i]),
                               nullptr, xi.data(), reference.col(i).data());
    }
  }
  problem.SetParameterBlockConstant(xi.data());
  for (const auto& [i, j, w] : paperPairs(s.tree, s.settings)) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Difference, 3, 3, 3>(new Difference{s.settings.lambda2 * w}), nullptr,
        reference.col(i).data(), reference.col(j).data());
  }
  ceres::Solver::Options options;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-16;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);

  NonrigidStep step(s.tree, s.settings);
  Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, n);
  for (int k = 0; k < 10; ++k) {
    const auto solved = step.solve(s.views, s.T, s.pulls, displacements);
    ASSERT_TRUE(solved);
    displacements = *solved;
  }
  // Metres: Ceres stops when the cost, flat to second order, no longer changes in the last of sixteen digits.
  EXPECT_LT((displacements - reference).cwiseAbs().maxCoeff(), 1e-9);
  // Both name the same cost: Ceres counts half of it.
  double cost = step.regulariser(displacements);
  for (std::size_t v = 0; v < 2; ++v) {
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector2d u = s.pixel(v, s.tree.points().col(i) + displacements.col(i));
      cost += s.pulls[v].weight[i] * (u - s.pulls[v].target_px.col(i)).squaredNorm();
    }
  }
  EXPECT_NEAR(cost, 2 * summary.final_cost, 1e-9 * cost);
}

// From displacements of centimetres the plain step may raise the cost; a damped one never does, and comes to rest where
// the plain ones do.
TEST(NonrigidStep, DampedStepsNeverRaiseTheCost) {
  NonrigidScene s;
  const int n = s.tree.size();
  NonrigidStep system(s.tree, s.settings);
  Eigen::Matrix3Xd plain = Eigen::Matrix3Xd::Zero(3, n);
  for (int k = 0; k < 10; ++k) plain = *system.solve(s.views, s.T, s.pulls, plain);
  for (const double far_m : {1e-3, 30e-3, 0.2}) {
    DampedNonrigid solver(system);
    Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::NullaryExpr(3, n, [&] { return far_m * s.random.normal(); });
    double cost = system.cost(s.views, s.T, s.pulls, displacements);
    for (int k = 0; k < 40; ++k) {
      const auto stepped = solver.step(s.views, s.T, s.pulls, displacements);
      if (!stepped) break;
      displacements = *stepped;
      const double now = system.cost(s.views, s.T, s.pulls, displacements);
      EXPECT_LE(now, cost);
      cost = now;
    }
    // Metres: a step that changes the cost's last digit only is no step.
    EXPECT_LT((displacements - plain).cwiseAbs().maxCoeff(), 1e-8) << far_m;
  }
}

TEST(NonrigidStep, ReturnsToRestWhenTheImageIsTheProjectionItself) {
  NonrigidScene s;
  for (std::size_t v = 0; v < 2; ++v) {
    s.pulls[v].weight.setOnes();
    for (int i = 0; i < s.tree.size(); ++i) s.pulls[v].target_px.col(i) = s.pixel(v, s.tree.points().col(i));
  }
  NonrigidStep step(s.tree, s.settings);
  Eigen::Matrix3Xd displacements =
      Eigen::Matrix3Xd::NullaryExpr(3, s.tree.size(), [&] { return 1e-3 * s.random.normal(); });
  for (int k = 0; k < 5; ++k) displacements = *step.solve(s.views, s.T, s.pulls, displacements);
  EXPECT_LT(displacements.cwiseAbs().maxCoeff(), 1e-12);  // Rounding of pixels near 500, in metres.
}

TEST(NonrigidStep, MovingEveryPointAlikeCostsItsSizeOnly) {
  NonrigidScene s;
  const NonrigidStep step(s.tree, s.settings);
  const Eigen::Vector3d shift_mm(1, -2, 0.5);
  const Eigen::Matrix3Xd alike = (1e-3 * shift_mm).replicate(1, s.tree.size());
  EXPECT_NEAR(step.regulariser(alike), s.settings.lambda2 * s.settings.w1 * s.tree.size() * shift_mm.squaredNorm(),
              1e-9);
}

TEST(NonrigidStep, RegulariserCountsChainsOncePerSide) {
  // Three points in a row, the last one 2 mm off: size once, and the edge to its neighbour from both ends.
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, 3);
  points.row(0) << 0, 1e-3, 2e-3;
  IterativePnpSettings settings;
  settings.regulariser_neighbours = 0;
  const NonrigidStep step(VesselTree(points, {-1, 0, 1}), settings);
  Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, 3);
  displacements(1, 2) = 2e-3;
  EXPECT_NEAR(step.regulariser(displacements), 4 * settings.w1 + 2 * 4 * settings.w2, 1e-9);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// Every Jacobian of the registration three ways: as written, by differences, and by automatic differentiation of a twin
// that shares no code with it.
#include <ceres/autodiff_cost_function.h>
#include <ceres/gradient_checker.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include "angio/geometry/decompositions.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "biplane.hpp"
#include "ceres_costs.hpp"
#include "rigid_step.hpp"

namespace angio::test {
namespace {

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;

template <typename T>
Matrix3<T> cross(const Vector3<T>& w) {
  Matrix3<T> W;
  W << T(0), -w.z(), w.y(), w.z(), T(0), -w.x(), -w.y(), w.x(), T(0);
  return W;
}

// The left Jacobian of SO(3) by its power series, sum W^k / (k + 1)!: no division by the angle, so it differentiates at
// zero too, and 18 terms leave less than 1e-16 for angles up to one.
template <typename T>
Matrix3<T> leftJacobian(const Vector3<T>& w) {
  const Matrix3<T> W = cross(w);
  Matrix3<T> sum = Matrix3<T>::Identity(), term = Matrix3<T>::Identity();
  for (int k = 1; k < 18; ++k) {
    term = term * W / T(k + 1);
    sum += term;
  }
  return sum;
}

template <typename T>
struct Rigid {
  Matrix3<T> R;
  Vector3<T> t;
};

template <typename T>
Rigid<T> timesExp(const Pose& A, const T* xi) {
  const Eigen::Map<const Vector3<T>> v(xi), w(xi + 3);
  Matrix3<T> R;
  ceres::AngleAxisToRotationMatrix(w.data(), R.data());
  const Matrix3<T> R_A = A.linear().cast<T>();
  return {R_A * R, R_A * (leftJacobian<T>(w) * v) + A.translation().cast<T>()};
}

struct ProjectionTwin {
  XrayCamera::Parameters camera;
  Pose T_camera_model;
  Eigen::Vector3d p_model;
  Eigen::Vector2d q_px;
  double weight;

  template <typename T>
  bool operator()(const T* xi, const T* r, T* residual) const {
    const Rigid<T> M = timesExp(T_camera_model, xi);
    const Eigen::Map<const Vector3<T>> displacement(r);
    const Vector3<T> p = M.R * (p_model.cast<T>() + displacement) + M.t;
    residual[0] = std::sqrt(weight) * (camera.fx_px * p.x() / p.z() + camera.cx_px - q_px.x());
    residual[1] = std::sqrt(weight) * (camera.fy_px * p.y() / p.z() + camera.cy_px - q_px.y());
    return true;
  }
};

struct PriorTwin {
  Pose T0_inverse_T;
  Matrix6d sqrt_information;  // L^T.

  template <typename T>
  bool operator()(const T* xi, T* residual) const {
    const Rigid<T> M = timesExp(T0_inverse_T, xi);
    Vector3<T> w;
    ceres::RotationMatrixToAngleAxis(M.R.data(), w.data());
    Eigen::Matrix<T, 6, 1> error;
    error << leftJacobian<T>(w).inverse() * M.t, w;
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residual);
    out = sqrt_information.cast<T>() * error;
    return true;
  }
};

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Largest difference of residuals and Jacobians of two costs, relative to the largest entry of each.
double difference(const ceres::CostFunction& a, const ceres::CostFunction& b,
                  const std::vector<const double*>& parameters) {
  const int rows = a.num_residuals();
  Eigen::VectorXd residual_a(rows), residual_b(rows);
  std::vector<RowMajor> J_a, J_b;
  for (const int size : a.parameter_block_sizes()) {
    J_a.emplace_back(rows, size);
    J_b.emplace_back(rows, size);
  }
  std::vector<double*> raw_a, raw_b;
  for (auto& J : J_a) raw_a.push_back(J.data());
  for (auto& J : J_b) raw_b.push_back(J.data());
  EXPECT_TRUE(a.Evaluate(parameters.data(), residual_a.data(), raw_a.data()));
  EXPECT_TRUE(b.Evaluate(parameters.data(), residual_b.data(), raw_b.data()));
  double worst = (residual_a - residual_b).cwiseAbs().maxCoeff() / (1 + residual_a.cwiseAbs().maxCoeff());
  for (std::size_t k = 0; k < J_a.size(); ++k) {
    worst = std::max(worst, (J_a[k] - J_b[k]).cwiseAbs().maxCoeff() / J_a[k].cwiseAbs().maxCoeff());
  }
  return worst;
}

// Largest difference between a cost's Jacobians and those of ceres::GradientChecker, relative to the largest entry. Its
// own verdict judges each entry by itself, and fails on two that are zero but for rounding.
double differenceFromNumeric(const ceres::CostFunction& cost, const std::vector<const double*>& parameters) {
  const std::vector<const ceres::Manifold*>* const no_manifolds = nullptr;
  ceres::GradientChecker checker(&cost, no_manifolds, ceres::NumericDiffOptions());
  ceres::GradientChecker::ProbeResults results;
  checker.Probe(parameters.data(), 1e-6, &results);
  EXPECT_EQ(results.jacobians.size(), cost.parameter_block_sizes().size());
  double worst = 0;
  for (std::size_t k = 0; k < results.jacobians.size(); ++k) {
    const auto difference = (results.jacobians[k] - results.numeric_jacobians[k]).cwiseAbs().maxCoeff();
    worst = std::max(worst, difference / results.jacobians[k].cwiseAbs().maxCoeff());
  }
  return worst;
}

// At the linearisation point, as an optimiser is after each step, and away from it.
const double kSpreads[] = {0, 1e-6, 0.01, 0.2};

TEST(ProjectionCost, JacobiansAgreeThreeWays) {
  test::Random random(1);
  const XrayCamera camera = test::clinicalCamera();
  for (const double spread : kSpreads) {
    for (int trial = 0; trial < 10; ++trial) {
      const Eigen::Vector3d p = random.vector(0.04);
      Pose T = Pose::Identity();
      T.linear() = expSO3(random.vector(1));
      T.translation() = Eigen::Vector3d(0.01, -0.02, 0.9);
      const Twist xi = random.twist(0.3 * spread, spread);
      const Eigen::Vector3d r = random.vector(1e-3);
      const Eigen::Vector2d q(random.uniform(0, 1024), random.uniform(0, 1024));
      const double weight = random.uniform(0.01, 1);
      const ProjectionCost cost(camera, T, p, q, weight);
      const ceres::AutoDiffCostFunction<ProjectionTwin, 2, 6, 3> twin(
          new ProjectionTwin{camera.parameters(), T, p, q, weight});
      const std::vector<const double*> parameters{xi.data(), r.data()};
      // Ridders' extrapolation keeps about ten digits of a smooth function.
      EXPECT_LT(differenceFromNumeric(cost, parameters), 1e-8) << spread;
      // Both are exact; near the threshold of the series the coefficients keep ten digits.
      EXPECT_LT(difference(cost, twin, parameters), 1e-10) << spread;
    }
  }
}

TEST(ProjectionCost, FailsForAPointBehindTheSourceAndWeighsSquares) {
  const Twist xi = Twist::Zero();
  const Eigen::Vector3d r = Eigen::Vector3d::Zero();
  const double* parameters[] = {xi.data(), r.data()};
  double residual[2];
  const XrayCamera camera = test::clinicalCamera();
  EXPECT_FALSE(
      ProjectionCost(camera, Pose::Identity(), {0, 0, -0.1}, {0, 0}, 1).Evaluate(parameters, residual, nullptr));
  const Eigen::Vector2d q = *camera.project({0, 0, 1}) - Eigen::Vector2d(3, 4);
  ASSERT_TRUE(ProjectionCost(camera, Pose::Identity(), {0, 0, 1}, q, 0.25).Evaluate(parameters, residual, nullptr));
  EXPECT_NEAR(residual[0] * residual[0] + residual[1] * residual[1], 0.25 * 25, 1e-9)
      << "weight times distance squared";
}

TEST(PosePriorCost, JacobiansAgreeThreeWays) {
  test::Random random(2);
  for (const double spread : kSpreads) {
    for (int trial = 0; trial < 10; ++trial) {
      const Pose T0 = expSE3(random.twist(0.5, 1)), T = T0 * expSE3(random.twist(spread, spread));
      const Twist xi = random.twist(spread, 0.5 * spread);
      const Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::NullaryExpr([&] { return random.normal(); });
      const Matrix6d information = A * A.transpose() + Matrix6d::Identity();
      const PosePriorCost cost(T0, T, information);
      const Matrix6d sqrt_information = lowerFactorOf(information).transpose();
      const ceres::AutoDiffCostFunction<PriorTwin, 6, 6> twin(new PriorTwin{T0.inverse() * T, sqrt_information});
      const std::vector<const double*> parameters{xi.data()};
      // Ridders' extrapolation keeps about ten digits of a smooth function.
      EXPECT_LT(differenceFromNumeric(cost, parameters), 1e-8) << spread;
      EXPECT_LT(difference(cost, twin, parameters), 1e-10) << spread;
      Vector6d residual;
      ASSERT_TRUE(cost.Evaluate(parameters.data(), residual.data(), nullptr));
      const Twist error = logSE3(T0.inverse() * T * expSE3(xi));
      EXPECT_NEAR(residual.squaredNorm(), error.dot(information * error), 1e-9 * (1 + residual.squaredNorm()));
    }
  }
}

TEST(NormalEquations, GradientIsThatOfTheCost) {
  test::Random random(3);
  const VesselTree tree = test::branchingTree(1);
  const XrayCamera camera = test::clinicalCamera(), other = XrayCamera::centered(800, 600, 0.4e-3, 1);
  const Centerline2d none;
  const XrayViews views{{none, camera}, {none, other, test::fromTheSide()}};
  const Eigen::Matrix3Xd points = (tree.points().colwise() - tree.centroid()).leftCols(60);
  for (int trial = 0; trial < 10; ++trial) {
    Pose T = Pose::Identity();
    T.linear() = expSO3(random.vector(1));
    T.translation() = Eigen::Vector3d(0, 0, 0.75);
    std::vector<Pull> pulls(2, Pull(60));
    for (Pull& pull : pulls) {
      for (int i = 0; i < 60; ++i) {
        pull.weight[i] = i % 7 == 0 ? 0 : random.uniform(0, 1);
        const double x = random.uniform(0, 1024), y = random.uniform(0, 1024);
        pull.target_px.col(i) << x, y;
      }
    }
    PosePriorTerm prior;
    prior.T0_camera_centered = T * expSE3(random.twist(5e-3, 0.1));
    prior.information.diagonal() << 1e8, 2e8, 3e8, 1e5, 2e5, 3e5;
    const auto cost = [&](const Eigen::VectorXd& dx) -> Eigen::VectorXd {
      return Eigen::VectorXd::Constant(1, irlsCost(points, views, T * expSE3(dx), pulls, prior));
    };
    const NormalEquations n = normalEquations(points, views, T, pulls, prior);
    const Eigen::VectorXd gradient = test::centralDifferences(cost, Twist::Zero(), 1e-5).transpose();
    // Differences of a cost near 1e7 with third derivatives near 1e11 keep six digits at this step.
    EXPECT_LT((2 * n.g - gradient).norm(), 2e-6 * gradient.norm());
    EXPECT_NEAR(n.cost_px2, irlsCost(points, views, T, pulls, prior), 1e-9 * n.cost_px2);
    EXPECT_LT((n.H - n.H.transpose()).norm(), 1e-12 * n.H.norm());
  }
}

// The Hessian from an independent side: the sum of J^T J of the costs made for Ceres.
TEST(NormalEquations, HessianIsThatOfTheCeresCosts) {
  test::Random random(4);
  const XrayCamera camera = test::clinicalCamera(), other = XrayCamera::centered(800, 600, 0.4e-3, 1);
  const Centerline2d none;
  const XrayViews views{{none, camera}, {none, other, test::fromTheSide()}};
  const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::NullaryExpr(3, 20, [&] { return 0.03 * random.normal(); });
  Pose T = Pose::Identity();
  T.linear() = expSO3(random.vector(1));
  T.translation() = Eigen::Vector3d(0, 0, 0.75);
  PosePriorTerm prior;
  prior.T0_camera_centered = T * expSE3(random.twist(5e-3, 0.1));
  prior.information.diagonal() << 1e8, 2e8, 3e8, 1e5, 2e5, 3e5;
  std::vector<Pull> pulls(2, Pull(20));
  Matrix6d H = Matrix6d::Zero();
  const Twist xi = Twist::Zero();
  const Eigen::Vector3d r = Eigen::Vector3d::Zero();
  const double* parameters[] = {xi.data(), r.data()};
  const auto add = [&](const ceres::CostFunction& cost) {
    RowMajor J(cost.num_residuals(), 6);
    Eigen::VectorXd residual(cost.num_residuals());
    double* jacobians[] = {J.data(), nullptr};
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    H += J.transpose() * J;
  };
  for (std::size_t v = 0; v < 2; ++v) {
    Pull& pull = pulls[v];
    for (int i = 0; i < 20; ++i) {
      pull.weight[i] = random.uniform(0, 1);
      const double x = random.uniform(0, 1024), y = random.uniform(0, 1024);
      pull.target_px.col(i) << x, y;
      add(ProjectionCost(views[v].camera, views[v].T_view_first * T, points.col(i), pull.target_px.col(i),
                         pull.weight[i]));
    }
  }
  const NormalEquations n = normalEquations(points, views, T, pulls, prior);
  EXPECT_LT((n.H_data - H).norm(), 1e-12 * H.norm());
  add(PosePriorCost(prior.T0_camera_centered, T, prior.information));
  EXPECT_LT((n.H - H).norm(), 1e-10 * H.norm());
}

}  // namespace
}  // namespace angio::test

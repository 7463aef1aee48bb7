// SPDX-License-Identifier: GPL-2.0-or-later
// DT-ICP's own parts: the distance transform, every cost's Jacobian, and laws of its stages.
#include <ceres/autodiff_cost_function.h>
#include <gtest/gtest.h>

#include "angio/geometry/decompositions.hpp"
#include "angio/registration/registration.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "biplane.hpp"
#include "displacement_fit.hpp"
#include "distance_fit.hpp"

namespace angio::test {
namespace {

// A tree seen from the front and from the side.
struct DistanceScene {
  test::Random random{21};
  VesselTree tree = test::branchingTree(2);
  XrayCamera camera = test::clinicalCamera();
  Pose truth = test::viewOf(tree, random);
  Centerline2d front = projectedCenterline(tree, camera, truth);
  Centerline2d side = projectedCenterline(tree, camera, test::fromTheSide() * truth);
  XrayViews views{{front, camera}, {side, camera, test::fromTheSide()}};
  DistanceFrame frame{views, 2};
  Eigen::Matrix3Xd centered = tree.points().colwise() - tree.centroid();
  Pose truth_centered = truth * Eigen::Translation3d(tree.centroid());

  // Off by so much, about the centroid.
  Pose off(double rotation_deg, double translation_m) {
    Twist xi;
    xi << translation_m * random.direction(), degToRad(rotation_deg) * random.direction();
    return truth_centered * expSE3(xi);
  }
};

// An image of one straight vessel whose ends are no cells of the grid.
Centerline2d slantedLine(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  Eigen::Matrix2Xd points(2, 21);
  for (int i = 0; i < 21; ++i) points.col(i) = from + i / 20.0 * (to - from);
  return makeCenterline(points, std::vector<int>(21, 0));
}

TEST(DistanceField, IsExactBesideAStraightVessel) {
  const Eigen::Vector2d from(301.3, 255.7), to(612.9, 433.1), along = (to - from).normalized(),
                                                              normal(-along.y(), along.x());
  const DistanceField field(slantedLine(from, to), test::clinicalCamera());
  test::Random random(1);
  for (int trial = 0; trial < 300; ++trial) {
    // Half of them where the cubic reads nothing but exact cells.
    const double across = random.uniform(-1, 1) * (trial % 2 == 0 ? 1.5 : 150);
    const Eigen::Vector2d pixel = from + random.uniform(30, 300) * along + across * normal;
    const auto sample = field.at(pixel);
    if (trial % 2 == 0) {
      // A square is what the cubic reproduces; cells are kept in single precision.
      EXPECT_NEAR(sample.squared_px2, across * across, 1e-4);
      EXPECT_LT((sample.gradient_px - 2 * across * normal).norm(), 1e-4);
    } else {
      // A drawn line is off by up to half a cell's diagonal.
      EXPECT_NEAR(std::sqrt(sample.squared_px2), std::abs(across), 1.5);
    }
  }
}

TEST(DistanceField, IsTheDistanceFromTheNearestVesselAnywhere) {
  DistanceScene s;
  const DistanceField field(s.front, s.camera);
  const auto exact = [&](const Eigen::Vector2d& pixel) {
    double least = 1e12;
    for (int i = 0; i + 1 < s.front.size(); ++i) {
      if (s.front.branch[i] != s.front.branch[i + 1]) continue;
      const Eigen::Vector2d a = s.front.points_px.col(i), b = s.front.points_px.col(i + 1) - a;
      const double share = std::clamp((pixel - a).dot(b) / b.squaredNorm(), 0.0, 1.0);
      least = std::min(least, (pixel - a - share * b).norm());
    }
    return least;
  };
  double worst_px = 0, sum_px = 0;
  const int trials = 3000;
  for (int trial = 0; trial < trials; ++trial) {
    // On the detector, on the border, and beyond it.
    const double x = s.random.uniform(-300, 1300), y = s.random.uniform(-300, 1300);
    const Eigen::Vector2d pixel(x, y);
    const double off_px = std::abs(std::sqrt(field.at(pixel).squared_px2) - exact(pixel));
    if (s.camera.sees(pixel)) worst_px = std::max(worst_px, off_px);
    sum_px += off_px;
  }
  // A drawn line is off by 0.7 cells at most, and where two vessels are equally far the cubic rounds the ridge.
  EXPECT_LT(worst_px, 4);
  // Beyond the border the way straight back to it is longer than the way to the vessel, up to 240 px away.
  EXPECT_LT(sum_px / trials, 10);
}

TEST(DistanceField, GradientIsThatOfTheValue) {
  DistanceScene s;
  const DistanceField field(s.front, s.camera);
  for (int trial = 0; trial < 200; ++trial) {
    const double x = s.random.uniform(-300, 1300), y = s.random.uniform(-300, 1300);
    const auto value = [&](const Eigen::VectorXd& at) -> Eigen::VectorXd {
      return Eigen::VectorXd::Constant(1, field.at(at).squared_px2);
    };
    const Eigen::VectorXd numeric = test::centralDifferences(value, Eigen::Vector2d(x, y), 1e-4).transpose();
    const auto sample = field.at({x, y});
    // A cubic's third derivative, and the rounding of values up to 1e5.
    EXPECT_LT((sample.gradient_px - numeric).norm(), 1e-5 * (1 + numeric.norm())) << x << " " << y;
  }
}

TEST(DistanceField, IsEmptyWithoutACentrelineNearTheDetector) {
  EXPECT_TRUE(DistanceField(slantedLine({5000, 5000}, {5100, 5000}), test::clinicalCamera()).empty());
  EXPECT_TRUE(DistanceField(slantedLine({1e300, 0}, {1e300, 1e300}), test::clinicalCamera()).empty());
  EXPECT_FALSE(DistanceField(slantedLine({500, -50}, {600, -50}), test::clinicalCamera()).empty());
}

TEST(PoseManifold, JacobiansAreThoseOfPlusAndMinus) {
  test::Random random(3);
  const PoseManifold manifold;
  for (int trial = 0; trial < 20; ++trial) {
    const PoseBlock x = blockOf(expSE3(random.twist(0.5, 1)));
    const auto plus = [&](const Eigen::VectorXd& dx) -> Eigen::VectorXd {
      PoseBlock out;
      manifold.Plus(x.data(), dx.data(), out.data());
      return out;
    };
    Eigen::Matrix<double, 12, 6, Eigen::RowMajor> J_plus;
    Eigen::Matrix<double, 6, 12, Eigen::RowMajor> J_minus;
    manifold.PlusJacobian(x.data(), J_plus.data());
    manifold.MinusJacobian(x.data(), J_minus.data());
    EXPECT_LT((test::centralDifferences(plus, Twist::Zero(), 1e-5) - J_plus).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((J_minus * J_plus - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 1e-12);
    const Twist dx = random.twist(0.2, 0.8);
    const PoseBlock y = plus(dx);
    Twist back;
    manifold.Minus(y.data(), x.data(), back.data());
    EXPECT_LT((back - dx).norm(), 1e-12);
  }
}

constexpr double kHuber_px = 3;

using RowMajorX = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Residuals and Jacobians of a cost.
struct Evaluated {
  Eigen::VectorXd residuals;
  std::vector<RowMajorX> J;

  Evaluated(const ceres::CostFunction& cost, const std::vector<const double*>& parameters)
      : residuals(cost.num_residuals()) {
    for (const int size : cost.parameter_block_sizes()) J.emplace_back(cost.num_residuals(), size);
    std::vector<double*> raw;
    for (RowMajorX& block : J) raw.push_back(block.data());
    EXPECT_TRUE(cost.Evaluate(parameters.data(), residuals.data(), raw.data()));
  }
};

// Largest difference between a cost's Jacobians and numeric ones, relative to the largest entry of each block.
double offFromNumeric(const ceres::CostFunction& cost, const std::vector<const double*>& parameters) {
  const Evaluated analytic(cost, parameters);
  double worst = 0;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const auto residuals = [&](const Eigen::VectorXd& block) -> Eigen::VectorXd {
      std::vector<const double*> moved = parameters;
      moved[k] = block.data();
      Eigen::VectorXd out(cost.num_residuals());
      EXPECT_TRUE(cost.Evaluate(moved.data(), out.data(), nullptr));
      return out;
    };
    const Eigen::VectorXd at = Eigen::Map<const Eigen::VectorXd>(parameters[k], cost.parameter_block_sizes()[k]);
    // A thousandth of a pixel: beside the centreline the residual turns within kSoft_px.
    const Eigen::MatrixXd numeric = test::centralDifferences(residuals, at, 2e-7);
    worst = std::max(worst, (analytic.J[k] - numeric).cwiseAbs().maxCoeff() / numeric.cwiseAbs().maxCoeff());
  }
  return worst;
}

// The same costs, written for automatic differentiation. The field brings its own gradient, which has a test above.
// Huber's loss turns linear at `huber_px`.
template <typename T>
T residualOf(const DistanceField& field, const XrayCamera::Parameters& camera, double huber_px,
             const Eigen::Matrix<T, 3, 1>& p) {
  const T u = camera.fx_px * p.x() / p.z() + camera.cx_px, v = camera.fy_px * p.y() / p.z() + camera.cy_px;
  T squared;
  if constexpr (std::is_same_v<T, double>) {
    squared = field.at({u, v}).squared_px2;
  } else {
    const auto sample = field.at({u.a, v.a});
    squared.a = sample.squared_px2;
    squared.v = sample.gradient_px.x() * u.v + sample.gradient_px.y() * v.v;
  }
  const T distance = sqrt(squared + DistanceResidual::kSoft_px * DistanceResidual::kSoft_px);
  return distance < huber_px ? distance : sqrt(2 * huber_px * distance - huber_px * huber_px);
}

struct TreeDistanceTwin {
  const Eigen::Matrix3Xd& points;
  const DistanceField& field;
  const XrayView& view;
  double huber_px;

  template <typename T>
  bool operator()(const T* pose, const T* e, T* residuals) const {
    Eigen::Matrix<T, 3, 3> R, E;
    for (int k = 0; k < 9; ++k) R(k % 3, k / 3) = pose[k];
    E << e[0], e[3], e[4], e[3], e[1], e[5], e[4], e[5], e[2];
    const Eigen::Matrix<T, 3, 1> t(pose[9], pose[10], pose[11]);
    for (int i = 0; i < points.cols(); ++i) {
      const Eigen::Matrix<T, 3, 1> q = points.col(i).cast<T>(), p = R * (q + E * q) + t;
      const Eigen::Matrix<T, 3, 1> p_view =
          view.T_view_first.linear().cast<T>() * p + view.T_view_first.translation().cast<T>();
      residuals[i] = residualOf(field, view.camera.parameters(), huber_px, p_view);
    }
    return true;
  }
};

TEST(TreeDistanceCost, JacobiansAgreeThreeWays) {
  DistanceScene s;
  constexpr int kChosen = 40;
  const Eigen::Matrix3Xd points = s.centered.leftCols(kChosen);
  const ceres::TrivialLoss squares;
  const ceres::HuberLoss huber(kHuber_px);
  for (int trial = 0; trial < 12; ++trial) {
    const std::size_t v = trial % 2;
    const bool with_huber = trial % 4 < 2;
    const PoseBlock pose = blockOf(s.off(3, 8e-3));
    const Vector6d strain = Vector6d::NullaryExpr([&] { return 0.02 * s.random.normal(); });
    const std::vector<const double*> parameters{pose.data(), strain.data()};
    const ceres::LossFunction& loss = with_huber ? static_cast<const ceres::LossFunction&>(huber) : squares;
    const TreeDistanceCost cost(points, s.frame.field(v), s.views[v], loss);
    const ceres::AutoDiffCostFunction<TreeDistanceTwin, kChosen, 12, 6> twin(
        new TreeDistanceTwin{points, s.frame.field(v), s.views[v], with_huber ? kHuber_px : 1e9});
    // A step across a cell's side meets another cubic: the derivative goes on, its slope does not.
    EXPECT_LT(offFromNumeric(cost, parameters), 1e-3);
    const Evaluated a(cost, parameters), b(twin, parameters);
    EXPECT_LT((a.residuals - b.residuals).cwiseAbs().maxCoeff(), 1e-9);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_LT((a.J[k] - b.J[k]).cwiseAbs().maxCoeff(), 1e-9 * b.J[k].cwiseAbs().maxCoeff());
    }
  }
}

// The squares of the residuals are the losses that Ceres has for the distances.
TEST(TreeDistanceCost, HubersLossIsThatOfCeres) {
  DistanceScene s;
  const ceres::HuberLoss huber(kHuber_px);
  const ceres::TrivialLoss squares;
  const PoseBlock pose = blockOf(s.off(3, 8e-3));
  const Vector6d strain = Vector6d::Zero();
  const std::vector<const double*> parameters{pose.data(), strain.data()};
  const Evaluated ours(TreeDistanceCost(s.centered, s.frame.field(0), s.views[0], huber), parameters);
  const Evaluated plain(TreeDistanceCost(s.centered, s.frame.field(0), s.views[0], squares), parameters);
  int beyond = 0;
  for (int i = 0; i < s.centered.cols(); ++i) {
    double rho[3];
    huber.Evaluate(plain.residuals[i] * plain.residuals[i], rho);
    EXPECT_NEAR(ours.residuals[i] * ours.residuals[i], rho[0], 1e-9 * (1 + rho[0]));
    // Half the gradient of rho(d^2) is rho' d d'.
    const Eigen::RowVectorXd gradient = rho[1] * plain.residuals[i] * plain.J[0].row(i);
    EXPECT_LT((ours.residuals[i] * ours.J[0].row(i) - gradient).norm(), 1e-9 * (1 + gradient.norm()));
    beyond += plain.residuals[i] > kHuber_px ? 1 : 0;
  }
  EXPECT_GT(beyond, s.centered.cols() / 4) << "the linear part was hardly tried";
}

TEST(TreeDistanceCost, FailsForAPointBehindTheSource) {
  DistanceScene s;
  const ceres::TrivialLoss loss;
  const TreeDistanceCost cost(s.centered, s.frame.field(0), s.views[0], loss);
  Pose behind = s.truth_centered;
  behind.translation().z() = 0.01;
  const PoseBlock pose = blockOf(behind);
  const Vector6d strain = Vector6d::Zero();
  const double* parameters[] = {pose.data(), strain.data()};
  Eigen::VectorXd residuals(cost.num_residuals());
  EXPECT_FALSE(cost.Evaluate(parameters, residuals.data(), nullptr));
}

TEST(StartCost, IsTheTermOfThePriorAndItsGradientToo) {
  DistanceScene s;
  for (int trial = 0; trial < 10; ++trial) {
    const Matrix6d A = Matrix6d::NullaryExpr([&] { return s.random.normal(); });
    PosePriorTerm prior;
    prior.T0_camera_centered = s.off(10, 20e-3);
    prior.information = A * A.transpose() + Matrix6d::Identity();
    const Pose T = s.off(10, 20e-3);
    const PoseBlock x = blockOf(T);
    const StartCost cost(prior);
    const Evaluated at(cost, {x.data()});
    EXPECT_NEAR(at.residuals.squaredNorm(), prior.cost(T), 1e-9 * (1 + prior.cost(T)));
    // Numerically along the manifold, where the poses are.
    const PoseManifold manifold;
    const auto residuals = [&](const Eigen::VectorXd& dx) -> Eigen::VectorXd {
      PoseBlock moved;
      manifold.Plus(x.data(), dx.data(), moved.data());
      Vector6d out;
      const double* parameters[] = {moved.data()};
      EXPECT_TRUE(cost.Evaluate(parameters, out.data(), nullptr));
      return out;
    };
    Eigen::Matrix<double, 12, 6, Eigen::RowMajor> J_plus;
    manifold.PlusJacobian(x.data(), J_plus.data());
    const Eigen::MatrixXd analytic = at.J[0] * J_plus;
    EXPECT_LT((test::centralDifferences(residuals, Twist::Zero(), 1e-5) - analytic).cwiseAbs().maxCoeff(),
              1e-8 * analytic.cwiseAbs().maxCoeff());
  }
}

struct PointDistanceTwin {
  const DistanceField& field;
  const XrayView& view;
  Eigen::Vector3d p_first;
  double huber_px;

  template <typename T>
  bool operator()(const T* r, T* residual) const {
    const Eigen::Matrix<T, 3, 1> p(p_first.x() + r[0], p_first.y() + r[1], p_first.z() + r[2]);
    const Eigen::Matrix<T, 3, 1> p_view =
        view.T_view_first.linear().cast<T>() * p + view.T_view_first.translation().cast<T>();
    residual[0] = residualOf(field, view.camera.parameters(), huber_px, p_view);
    return true;
  }
};

TEST(DisplacementCosts, JacobiansAgreeThreeWays) {
  DistanceScene s;
  const Pose T = s.off(2, 5e-3);
  for (int trial = 0; trial < 30; ++trial) {
    const std::size_t v = trial % 2;
    const Eigen::Vector3d p = T * s.centered.col(11 * trial), r = s.random.vector(1e-3), other = s.random.vector(1e-3);
    const ceres::HuberLoss huber(kHuber_px);
    const PointDistanceCost cost(s.frame.field(v), s.camera, s.views[v].T_view_first, p, huber);
    const ceres::AutoDiffCostFunction<PointDistanceTwin, 1, 3> twin(
        new PointDistanceTwin{s.frame.field(v), s.views[v], p, kHuber_px});
    const Evaluated a(cost, {r.data()}), b(twin, {r.data()});
    EXPECT_NEAR(a.residuals[0], b.residuals[0], 1e-9);
    EXPECT_LT((a.J[0] - b.J[0]).cwiseAbs().maxCoeff(), 1e-10 * b.J[0].cwiseAbs().maxCoeff());
    EXPECT_LT(offFromNumeric(cost, {r.data()}), 1e-3);
    EXPECT_LT(offFromNumeric(DisplacementSizeCost(0.3), {r.data()}), 1e-8);
    EXPECT_LT(offFromNumeric(DisplacementPairCost(7), {r.data(), other.data()}), 1e-8);
    const Vector6d strain = Vector6d::NullaryExpr([&] { return 0.02 * s.random.normal(); });
    EXPECT_LT(offFromNumeric(StrainCost(5), {strain.data()}), 1e-8);
    // Lengths count in millimetres.
    EXPECT_NEAR(Evaluated(DisplacementPairCost(7), {r.data(), other.data()}).residuals.squaredNorm(),
                7e6 * (r - other).squaredNorm(), 1e-9);
  }
}

TEST(PoseFit, TheCostNeverRisesFromStepToStep) {
  DistanceScene s;
  const ChosenLoss loss{DtIcpSettings()};
  PosePriorTerm none;
  none.source = PriorInForce::kNone;
  for (int trial = 0; trial < 3; ++trial) {
    PoseFit fit(s.frame, loss.get(), s.centered, none, s.off(4, 10e-3));
    (void)fit.affine(3);
    double cost = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 30; ++k) {
      const StageResult step = fit.rigid(1);
      ASSERT_TRUE(step.solved);
      EXPECT_LE(step.cost, step.first_cost);
      // Where the step before ended, but for the rounding of a rotation that is made one again.
      EXPECT_LE(step.first_cost, cost * (1 + 1e-9));
      cost = step.cost;
    }
  }
}

TEST(DisplacementFit, TheCostNeverRisesFromStepToStep) {
  DistanceScene s;
  const ChosenLoss loss{DtIcpSettings()};
  DisplacementFit fit(s.tree, IterativePnpSettings());
  const Pose T = s.off(1, 3e-3) * Eigen::Translation3d(-s.tree.centroid());
  Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, s.tree.size());
  double first = 0, cost = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 8; ++k) {
    const StageResult step = fit.solve(s.frame, loss.get(), T, 1, displacements);
    ASSERT_TRUE(step.solved);
    if (k == 0) first = step.first_cost;
    EXPECT_LE(step.cost, step.first_cost);
    EXPECT_LE(step.first_cost, cost * (1 + 1e-9));
    cost = step.cost;
  }
  EXPECT_LT(cost, 0.5 * first) << "nothing moved, nothing was tested";
}

// Mean distance of the tree's points from where the truth has them [m].
double offFrom(const DistanceScene& s, const RegistrationResult& result) {
  Eigen::Matrix3Xd found = s.tree.points();
  if (result.displacements_m.size() > 0) found += result.displacements_m;
  return (result.T_camera_model * found - s.truth * s.tree.points()).colwise().norm().mean();
}

DtIcpSettings dtIcp(Deformation deformation, DistanceLoss loss) {
  DtIcpSettings settings;
  settings.deformation = deformation;
  settings.loss = loss;
  return settings;
}

TEST(DtIcp, StaysAtTheTruth) {
  DistanceScene s;
  for (const Deformation deformation : {Deformation::kRigid, Deformation::kNonrigid}) {
    for (const DistanceLoss loss : {DistanceLoss::kHuber, DistanceLoss::kL2}) {
      const auto result = makeRegistration(dtIcp(deformation, loss), s.tree)->align(s.front, s.camera, {s.truth, {}});
      EXPECT_EQ(result.status, RegistrationStatus::kConverged) << result.reason;
      // Interpolation leaves 0.05 px at bends, a tenth of which is 1 um across the beam and 20 um along it.
      EXPECT_LT(offFrom(s, result), 0.1e-3);
    }
  }
}

TEST(DtIcp, FindsTheTruthFromHalfADegree) {
  for (const Deformation deformation : {Deformation::kRigid, Deformation::kNonrigid}) {
    DistanceScene s;
    for (int trial = 0; trial < 5; ++trial) {
      const Pose start = s.off(0.5, 1e-3) * Eigen::Translation3d(-s.tree.centroid());
      const auto result =
          makeRegistration(dtIcp(deformation, DistanceLoss::kHuber), s.tree)->align(s.front, s.camera, {start, {}});
      EXPECT_EQ(result.status, RegistrationStatus::kConverged) << result.reason;
      EXPECT_EQ(result.prior, PriorInForce::kNone);
      EXPECT_LT(offFrom(s, result), 0.2e-3);
    }
  }
}

TEST(DtIcp, AStartThatIsKnownHoldsThePose) {
  DistanceScene s;
  const Pose start = s.off(0.5, 1e-3) * Eigen::Translation3d(-s.tree.centroid());
  const auto registration = makeRegistration(DtIcpSettings(), s.tree);
  PosePrior sure{start, Matrix6d(1e-14 * Matrix6d::Identity())};  // To a ten-thousandth of a millimetre.
  const auto held = registration->align(s.front, s.camera, sure);
  EXPECT_EQ(held.prior, PriorInForce::kGivenCovariance);
  EXPECT_LT((held.T_camera_model * s.tree.points() - start * s.tree.points()).cwiseAbs().maxCoeff(), 1e-4);
}

}  // namespace
}  // namespace angio::test

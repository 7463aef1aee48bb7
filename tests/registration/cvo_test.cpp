// SPDX-License-Identifier: GPL-2.0-or-later
#include <ceres/autodiff_cost_function.h>
#include <gtest/gtest.h>

#include <cmath>

#include "angio/registration/registration.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "biplane.hpp"
#include "kernel_flow.hpp"
#include "mean_distance.hpp"

namespace angio::test {
namespace {

constexpr double kMatch_m = 1e-3;

// A tree, what a view shows of it, and a pose that is off by about 10 px.
struct FlowScene {
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  Pose truth, start;  // Of the centred tree.
  Centerline2d image;
  XrayViews views;

  explicit FlowScene(unsigned seed) : tree(test::branchingTree(seed)) {
    test::Random random(seed + 40);
    const Pose T_camera_model = test::viewOf(tree, random);
    truth = T_camera_model * Eigen::Translation3d(tree.centroid());
    Twist off;
    off << 2e-3 * random.direction(), 0.02 * random.direction();
    start = truth * expSE3(off);
    image = projectedCenterline(tree, camera, T_camera_model);
    views.push_back({image, camera});
  }
};

// The objective of one view as its definition says, all pairs tried, with any scalar.
struct ObjectiveTwin {
  const FlowView* view;
  Pose T;
  const PairKernel* kernel;
  bool fixed_pairs;  // Those within reach at xi = 0; or those within reach.

  template <typename S>
  using Pixels = Eigen::Matrix<S, 2, Eigen::Dynamic>;

  template <typename S>
  Pixels<S> pixels(const S* xi) const {
    using V3 = Eigen::Matrix<S, 3, 1>;
    const auto& c = view->view->camera.parameters();
    const V3 v(xi[0], xi[1], xi[2]), w(xi[3], xi[4], xi[5]);
    const Pose T_view = view->view->T_view_first * T;
    Pixels<S> all(2, view->size());
    for (int i = 0; i < view->size(); ++i) {
      const V3 p = view->points.col(i).cast<S>();
      // exp(xi) p as its series: six terms are all that a double holds of a small twist.
      V3 moved = p, term = v + w.cross(p);
      for (int k = 1; k <= 6; ++k) {
        moved += term;
        term = w.cross(term) / S(k + 1.0);
      }
      const V3 q = T_view.linear().cast<S>() * moved + T_view.translation().cast<S>();
      all.col(i) << c.fx_px * q.x() / q.z() + c.cx_px, c.fy_px * q.y() / q.z() + c.cy_px;
    }
    return all;
  }

  template <typename S>
  bool operator()(const S* xi, S* value) const {
    const Pixels<S> u = pixels(xi);
    const double zero[6] = {};
    const Pixels<double> u0 = pixels(zero);
    const double l2 = kernel->scale_px * kernel->scale_px;
    const auto add = [&](const Eigen::Matrix<S, 2, 1>& apart, const Eigen::Vector2d& apart0, double cos2, double masses,
                         S& sum) {
      const double angle_factor = kernel->kappa * (cos2 - 1);
      const S k = exp(-apart.squaredNorm() / (2 * l2) + angle_factor);
      const double k0 = std::exp(-apart0.squaredNorm() / (2 * l2) + angle_factor);
      if (fixed_pairs ? k0 > PairKernel::kMinKernel : k > PairKernel::kMinKernel) {
        sum += masses * (k - PairKernel::kMinKernel);
      }
    };
    S image(0.0), model(0.0);
    for (int i = 0; i < view->size(); ++i) {
      for (int j = 0; j < view->image.size(); ++j) {
        const Eigen::Vector2d q = view->image.points_px.col(j);
        add(u.col(i) - q.cast<S>(), u0.col(i) - q, view->direction.col(i).dot(view->image.direction.col(j)),
            view->length_px[i] * view->image.length_px[j], image);
      }
      for (int j = 0; j < i; ++j) {
        add(u.col(i) - u.col(j), u0.col(i) - u0.col(j), view->direction.col(i).dot(view->direction.col(j)),
            view->length_px[i] * view->length_px[j], model);
      }
    }
    value[0] = 2 * l2 * view->unit * (image - model);
    return true;
  }
};

TEST(CvoObjective, GradientAgreesThreeWays) {
  const FlowScene s(1);
  const XrayView turned{s.image, s.camera, expSE3((Twist() << 1e-3, 0, 0, 0, 0.01, 0).finished())};
  const ModelSamples model = modelSamples(s.tree, 4e-3);
  for (const double scale_px : {20.0, 3.0}) {
    const PairKernel kernel(scale_px, 0.35, CvoObjective::kDistance);
    const FlowView view(model, turned, s.start, kernel, kMatch_m);
    ViewAlignment alignment;
    ASSERT_TRUE(alignView(view, s.start, kernel, alignment));
    ASSERT_GT(alignment.image_pairs.size(), 30u);
    ASSERT_GT(alignment.model_pairs.size(), 30u);
    const Vector6d gradient = twistGradient(view, s.start, alignment);

    const ceres::AutoDiffCostFunction<ObjectiveTwin, 1, 6> twin(new ObjectiveTwin{&view, s.start, &kernel, false});
    const Vector6d zero = Vector6d::Zero();
    const double* parameters[] = {zero.data()};
    double value = 0;
    Vector6d twin_gradient;
    double* jacobians[] = {twin_gradient.data()};
    ASSERT_TRUE(twin.Evaluate(parameters, &value, jacobians));
    // Sums of the same thousands of terms in another order.
    EXPECT_NEAR(alignment.value_px2, value, 1e-10 * std::abs(value));
    EXPECT_LT((gradient - twin_gradient).norm(), 1e-9 * twin_gradient.norm()) << scale_px;

    const auto objective = [&](const Eigen::VectorXd& dx) -> Eigen::VectorXd {
      ViewAlignment at;
      EXPECT_TRUE(alignView(view, s.start * expSE3(dx), kernel, at));
      return Eigen::VectorXd::Constant(1, at.value_px2);
    };
    const Eigen::VectorXd numeric = test::centralDifferences(objective, zero, 1e-7).transpose();
    // The gradient has kinks where pairs come within reach, of at most 1 % of a pair's own.
    EXPECT_LT((gradient - numeric).norm(), 1e-4 * gradient.norm()) << scale_px;
  }
}

TEST(CvoObjective, TaylorSeriesLeavesTheFifthPower) {
  const FlowScene s(2);
  const ModelSamples model = modelSamples(s.tree, 4e-3);
  const PairKernel kernel(12, 0.35, CvoObjective::kDistance);
  const FlowView view(model, s.views[0], s.start, kernel, kMatch_m);
  ViewAlignment alignment;
  ASSERT_TRUE(alignView(view, s.start, kernel, alignment));
  test::Random random(3);
  for (int trial = 0; trial < 4; ++trial) {
    const Twist xi = random.twist(1e-3, 0.02);
    const auto c = taylorAlong(view, s.start, xi, kernel, alignment);
    EXPECT_NEAR(c[0], twistGradient(view, s.start, alignment).dot(xi), 1e-10 * std::abs(c[0]));
    const ObjectiveTwin twin{&view, s.start, &kernel, true};
    const auto remainder = [&](double t) {
      const Twist along = t * xi;
      double value = 0;
      twin(along.data(), &value);
      return value - alignment.value_px2 - t * (c[0] + t * (c[1] + t * (c[2] + t * c[3])));
    };
    // Half the step leaves a 32nd, a little more or less for the sixth power.
    const double ratio = remainder(0.2) / remainder(0.1);
    EXPECT_GT(ratio, 16) << trial;
    EXPECT_LT(ratio, 64) << trial;
  }
}

TEST(CvoObjective, PiecesOfHalfAScaleAreFineEnough) {
  const FlowScene s(3);
  for (const double scale_px : {24.0, 12.0}) {
    const PairKernel kernel(scale_px, 0.35, CvoObjective::kDistance);
    ViewAlignment coarse, fine;
    const FlowView as_used(modelSamples(s.tree, 0.5 * scale_px / 5200), s.views[0], s.start, kernel, kMatch_m);
    const FlowView finer(modelSamples(s.tree, 0.1 * scale_px / 5200), s.views[0], s.start, kernel, kMatch_m);
    ASSERT_TRUE(alignView(as_used, s.start, kernel, coarse));
    ASSERT_TRUE(alignView(finer, s.start, kernel, fine));
    const Vector6d a = twistGradient(as_used, s.start, coarse), b = twistGradient(finer, s.start, fine);
    // Where a vessel ends, and where it turns within a piece, pieces of half a scale are seen.
    EXPECT_LT((a - b).norm(), 0.05 * b.norm()) << scale_px;
  }
}

TEST(FirstPeak, IsTheSmallestRootOfTheSlopeOrTheEnd) {
  // Slopes (1 - t)(3 - t)(5 - t) = 15 - 23 t + 9 t^2 - t^3, and with the first root beyond the end.
  EXPECT_NEAR(firstPeak({15, -23.0 / 2, 3, -0.25}, 10), 1, 1e-12);
  EXPECT_NEAR(firstPeak({15, -23.0 / 2, 3, -0.25}, 0.5), 0.5, 1e-12);
  EXPECT_NEAR(firstPeak({4, -1, 0, 0}, 10), 2, 1e-12) << "a parabola";
  EXPECT_NEAR(firstPeak({4, 0, 0, 0}, 10), 10, 1e-12) << "a line";
  EXPECT_NEAR(firstPeak({8, 0, 0, -0.25}, 10), 2, 1e-12) << "no term between";
  EXPECT_NEAR(firstPeak({1, 1, 1, 1}, 10), 10, 1e-12) << "nothing but rise";
}

TEST(KernelFlow, NeverLowersTheObjectiveOfAScale) {
  test::Random random(5);
  for (unsigned seed = 0; seed < 4; ++seed) {
    const FlowScene s(seed);
    const Pose T_side_first = test::fromTheSide();
    const Centerline2d side = projectedCenterline(
        s.tree, s.camera, T_side_first * s.truth * Eigen::Translation3d(s.tree.centroid()).inverse());
    const XrayViews both{{s.image, s.camera}, {side, s.camera, T_side_first}};
    PosePriorTerm prior;
    prior.T0_camera_centered = s.start * expSE3(random.twist(1e-3, 0.01));
    prior.information.diagonal() << 1e8, 1e8, 1e8, 1e5, 1e5, 1e5;
    const ModelSamples model = modelSamples(s.tree, 1e-3);
    int rose = 0;
    for (const XrayViews& views : {s.views, both}) {
      KernelFlow flow(views, prior, s.start, kMatch_m);
      for (const auto& [scale_px, objective] :
           {std::pair(16.0, CvoObjective::kInnerProduct), std::pair(16.0, CvoObjective::kDistance),
            std::pair(4.0, CvoObjective::kDistance)}) {
        ASSERT_TRUE(flow.begin(model, PairKernel(scale_px, 0.35, objective)));
        double before = flow.objective_px2();
        for (int k = 0; k < 12; ++k) {
          flow.step();
          EXPECT_GE(flow.objective_px2(), before) << seed << ", step " << k;
          rose += flow.objective_px2() > before ? 1 : 0;
          before = flow.objective_px2();
        }
      }
    }
    EXPECT_GT(rose, 20) << "the law was hardly tried";
  }
}

TEST(Cvo, StaysAtTheTruthAndFindsItFromNearBy) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    const FlowScene s(seed);
    const Eigen::Translation3d to_center(s.tree.centroid());
    const Pose truth = s.truth * to_center.inverse();
    const auto cvo = makeRegistration(CvoSettings(), s.tree);
    const auto stayed = cvo->align(s.image, s.camera, {truth, {}});
    EXPECT_EQ(stayed.status, RegistrationStatus::kConverged) << stayed.reason;
    EXPECT_EQ(stayed.prior, PriorInForce::kNone);
    // Model and image are cut into other pieces, and ends and bifurcations pull unevenly: within a tenth of a pixel
    // across the beam, and what looks the same in depth.
    EXPECT_LT(test::meanDistance(s.tree, stayed.T_camera_model, truth), 0.3e-3) << seed;
    EXPECT_LT(rotationAngle(stayed.T_camera_model.linear().transpose() * truth.linear()), degToRad(0.05)) << seed;

    test::Random random(seed + 80);
    const Twist off = (Twist() << 1e-3 * random.direction(), degToRad(0.5) * random.direction()).finished();
    const auto found = cvo->align(s.image, s.camera, {test::perturbed(truth, s.tree, off), {}});
    EXPECT_EQ(found.status, RegistrationStatus::kConverged) << found.reason;
    EXPECT_LT(test::meanDistance(s.tree, found.T_camera_model, stayed.T_camera_model), 0.1e-3)
        << seed << ": one answer, wherever near it the flow begins";
  }
}

TEST(LineSamples, KeepTheLengthOfWhatTheyAreCutFrom) {
  const FlowScene s(6);
  for (const double spacing_m : {0.3e-3, 1e-3, 7e-3}) {
    const ModelSamples model = modelSamples(s.tree, spacing_m);
    EXPECT_NEAR(model.length_m.sum(), s.tree.length(), 1e-9);
    EXPECT_LE(model.length_m.maxCoeff(), spacing_m * (1 + 1e-9));
  }
  // Two branches, the second with a gap, and one point that is alone.
  Eigen::Matrix2Xd points(2, 7);
  points << 0, 30, 30, 0, 10, 400, 7,  //
      0, 0, 40, 100, 100, 100, 7;
  const ImageSamples image = imageSamples(makeCenterline(points, {0, 0, 0, 1, 1, 1, 2}), 8);
  EXPECT_NEAR(image.length_px.sum(), 70 + 10, 1e-9);
  EXPECT_LE(image.length_px.maxCoeff(), 8 + 1e-9);
  EXPECT_NEAR((image.direction.colwise().norm().array() - 1).abs().maxCoeff(), 0, 1e-12);
}

}  // namespace
}  // namespace angio::test

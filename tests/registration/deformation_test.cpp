// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "angio/base/errors.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/test/differences.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "deformation_fit.hpp"

namespace angio::test {
namespace {

// A gentle wave of so many metres and without rigid part worth naming: half a period over the tree, along two axes.
Eigen::Matrix3Xd wave(const Eigen::Matrix3Xd& about_centroid, double size_m) {
  Eigen::Matrix3Xd d(3, about_centroid.cols());
  for (Eigen::Index i = 0; i < d.cols(); ++i) {
    const Eigen::Vector3d p = about_centroid.col(i) / 0.05;
    d.col(i) = size_m * Eigen::Vector3d(std::sin(2 * p.y()), std::sin(1.5 * p.x() + 0.5), std::cos(1.5 * p.y()) - 0.5);
  }
  return d;
}

Eigen::Matrix3Xd wave(const VesselTree& tree, double size_m) {
  return wave(tree.points().colwise() - tree.centroid(), size_m);
}

struct DeformedScene {
  test::Random random{5};
  VesselTree tree = test::branchingTree(3);
  XrayCamera camera = test::clinicalCamera();
  Pose T = test::viewOf(tree, random);  // T_camera_model.
  Pose T_second_first = Pose::Identity();
  OrientedKernelSettings settings;
  OrientedModel model{tree, settings};
  Pose T_centered = T * Eigen::Translation3d(model.centroid);
  std::vector<Centerline2d> centerlines;
  XrayViews views;
  OrientedFrame frame;

  DeformedScene() {
    T_second_first = Eigen::Translation3d(0, 0, 0.75) * Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitY()) *
                     Eigen::Translation3d(0, 0, -0.75);
    centerlines.reserve(2);
  }

  // Shows the tree with these displacements, 3 x N of the tree as given.
  void show(const Eigen::Matrix3Xd& displacements, int view_count = 1, double noise_px = 0) {
    const VesselTree deformed(tree.points() + displacements, tree.parents());
    for (int v = 0; v < view_count; ++v) {
      const Pose T_view_first = v == 0 ? Pose::Identity() : T_second_first;
      Centerline2d c = projectedCenterline(deformed, camera, T_view_first * T);
      for (Eigen::Index j = 0; j < c.points_px.cols(); ++j) {
        const double du = noise_px * random.normal(), dv = noise_px * random.normal();
        c.points_px.col(j) += Eigen::Vector2d(du, dv);
      }
      centerlines.push_back(makeCenterline(c.points_px, c.branch));
    }
    for (int v = 0; v < view_count; ++v) {
      views.push_back(
          XrayView{centerlines[static_cast<std::size_t>(v)], camera, v == 0 ? Pose::Identity() : T_second_first, {}});
    }
    frame.begin(views, settings);
  }

  PosePriorTerm belief() const { return beliefOf({T, {}}, settings, model.centroid); }

  Eigen::Matrix3Xd ofGivenPoints(const Eigen::Matrix3Xd& of_model) const {
    Eigen::Matrix3Xd result(3, tree.size());
    for (int i = 0; i < tree.size(); ++i) {
      const auto& place = model.resampled.place_of_original[static_cast<std::size_t>(i)];
      result.col(i) = (1 - place.weight) * of_model.col(place.a) + place.weight * of_model.col(place.b);
    }
    return result;
  }

  // Mean distance of corresponding projections in the first view [px].
  double projectionError(const DeformationFit::Result& r, const Eigen::Matrix3Xd& truth) const {
    const Eigen::Matrix3Xd found = ofGivenPoints(r.displacements_m);
    double sum = 0;
    for (int i = 0; i < tree.size(); ++i) {
      const Eigen::Vector3d p = tree.points().col(i);
      sum += (*camera.project(r.T_camera_centered * (p - model.centroid + found.col(i))) -
              *camera.project(T * (p + truth.col(i))))
                 .norm();
    }
    return sum / tree.size();
  }
};

// Random but smooth unknowns to linearise at.
Eigen::Matrix3Xd someNodes(const DeformationNodes& nodes, test::Random& random) {
  Eigen::Matrix3Xd at(3, nodes.size());
  for (int n = 0; n < nodes.size(); ++n) at.col(n) = random.vector(1e-3);
  return at;
}

DeformationEquations<3> someEquations(const DeformationNodes& nodes, test::Random& random) {
  DeformationEquations<3> data(nodes, Eigen::Matrix3d::Identity());
  for (int k = 0; k < 300; ++k) {
    const int edge = std::min(static_cast<int>(random.uniform(0, 1) * static_cast<double>(nodes.edges.size())),
                              static_cast<int>(nodes.edges.size()) - 1);
    const double weight = random.uniform(0, 1), w = random.uniform(0.1, 2), r = random.normal();
    const Twist J = 5000 * random.twist(1, 0.05);
    const Eigen::Vector3d h = random.vector(5000);
    data.add({edge, weight}, w, r, J, h);
  }
  return data;
}

// The nodes' part of the equations as one dense matrix, and its gradient.
struct Dense {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};
Dense denseOf(const DeformationEquations<3>& data, const DeformationNodes& nodes) {
  const int n = 6 + 3 * nodes.size();
  Dense dense{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  dense.H.topLeftCorner<6, 6>() = data.H;
  dense.g.head<6>() = data.g;
  for (int k = 0; k < nodes.size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    dense.H.block<3, 3>(6 + 3 * k, 6 + 3 * k) = data.own[i];
    dense.H.block<6, 3>(0, 6 + 3 * k) = data.mixed[i];
    dense.H.block<3, 6>(6 + 3 * k, 0) = data.mixed[i].transpose();
    dense.g.segment<3>(6 + 3 * k) = data.pull[i];
  }
  for (std::size_t e = 0; e < nodes.edges.size(); ++e) {
    const auto [a, b] = nodes.edges[e];
    dense.H.block<3, 3>(6 + 3 * a, 6 + 3 * b) += data.along[e];
    dense.H.block<3, 3>(6 + 3 * b, 6 + 3 * a) += data.along[e].transpose();
  }
  return dense;
}

TEST(DeformationEquations, LinePullIsTheGradientOfTheSquares) {
  DeformedScene s;
  s.show(wave(s.tree, 1e-3));
  const DeformationNodes nodes(s.model, 10e-3);
  const Eigen::Matrix3Xd at = someNodes(nodes, s.random);
  const Eigen::Matrix3Xd displaced = s.model.points + nodes.atPoints(at);
  ProjectedEdges projected;
  projected.project(displaced, s.model.edges, s.camera, s.T_centered);
  LineMatches matches;
  matchLines(s.frame.points(0), projected, 20, 0.5, matches);
  ASSERT_GT(matches.matched, 300);
  DeformationEquations<3> data(nodes, Eigen::Matrix3d::Identity());
  // A tolerance without end leaves the squares alone.
  data.addLinePull({s.camera, s.T_centered, displaced}, s.model, s.frame.points(0), matches, 1e9, 0.7);

  const int some = 12;  // Pose, and a dozen of the nodes.
  const auto halfSquares = [&](const Eigen::VectorXd& x) {
    Eigen::Matrix3Xd moved = at;
    for (int k = 0; k < some; ++k) moved.col(5 * k) += x.segment<3>(6 + 3 * k);
    const Eigen::Matrix3Xd points = s.model.points + nodes.atPoints(moved);
    const Pose T = s.T_centered * expSE3(x.head<6>());
    double sum = 0;
    for (std::size_t j = 0; j < matches.of_point.size(); ++j) {
      const auto& m = matches.of_point[j];
      if (m.edge < 0) continue;
      const auto [a, b] = s.model.edges[static_cast<std::size_t>(m.edge)];
      const Eigen::Vector3d p = (1.0 - m.along) * points.col(a) + m.along * points.col(b);
      const Eigen::Vector2d d =
          *s.camera.project(T * p) - Eigen::Vector2d(s.frame.points(0).u[j], s.frame.points(0).v[j]);
      const double r = m.normal_u * d.x() + m.normal_v * d.y();
      sum += 0.35 * r * r;
    }
    return Eigen::VectorXd::Constant(1, sum);
  };
  ASSERT_GT(nodes.size(), 5 * some);
  const Eigen::VectorXd numeric =
      test::centralDifferences(halfSquares, Eigen::VectorXd::Zero(6 + 3 * some), 1e-6).row(0).transpose();
  Eigen::VectorXd analytic(6 + 3 * some);
  analytic.head<6>() = data.g;
  for (int k = 0; k < some; ++k) analytic.segment<3>(6 + 3 * k) = data.pull[static_cast<std::size_t>(5 * k)];
  // A model edge that passes a node counts on one side of it: some tenths of its length of 1 mm in 10 mm.
  EXPECT_LT((numeric - analytic).head<6>().norm(), 1e-5 * analytic.head<6>().norm());
  EXPECT_LT((numeric - analytic).tail(3 * some).norm(), 0.05 * analytic.tail(3 * some).norm());
  EXPECT_NEAR(data.squares_px2, 2 * halfSquares(Eigen::VectorXd::Zero(6 + 3 * some))[0], 1e-6 * data.squares_px2);
}

TEST(DeformationEquations, FieldPullIsTheGradientOfTheLikelihood) {
  DeformedScene s;
  s.show(wave(s.tree, 1e-3));
  const DeformationNodes nodes(s.model, 10e-3);
  const Eigen::Matrix3Xd at = someNodes(nodes, s.random);
  const Eigen::Matrix3Xd displaced = s.model.points + nodes.atPoints(at);
  const KernelField& field = s.frame.field(0, 1);
  PullWeight pull;
  pull.along = 0.3f;
  DeformationEquations<3> data(nodes, Eigen::Matrix3d::Identity());
  data.addFieldPull({s.camera, s.T_centered, displaced}, s.model, field, s.frame.fieldOfView(0), pull, 1, 1);
  const int some = 12;
  const auto likelihood = [&](const Eigen::VectorXd& x) {
    Eigen::Matrix3Xd moved = at;
    for (int k = 0; k < some; ++k) moved.col(5 * k) += x.segment<3>(3 * k);
    const Eigen::Matrix3Xd points = s.model.points + nodes.atPoints(moved);
    double sum = 0;
    for (int i = 0; i < s.model.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      const auto& m = s.model.all;
      const Eigen::Vector3d p = s.T_centered * points.col(i),
                            t = s.T_centered.linear() * Eigen::Vector3d(m.tx[k], m.ty[k], m.tz[k]);
      const double du = t.x() - p.x() / p.z() * t.z(), dv = t.y() - p.y() / p.z() * t.z(), length2 = du * du + dv * dv;
      const double length = std::min(1.0, std::sqrt(length2));
      const double F =
          field.at(*s.camera.project(p), (du * du - dv * dv) / length2 * length, 2 * du * dv / length2 * length).F;
      sum += m.weight[k] * length * std::log(std::max(0.0, F) + pull.outlier_mass);
    }
    return Eigen::VectorXd::Constant(1, sum);
  };
  const Eigen::VectorXd numeric =
      test::centralDifferences(likelihood, Eigen::VectorXd::Zero(3 * some), 1e-7).row(0).transpose();
  Eigen::VectorXd analytic(3 * some);
  for (int k = 0; k < some; ++k) analytic.segment<3>(3 * k) = -data.pull[static_cast<std::size_t>(5 * k)];
  ASSERT_GT(analytic.norm(), 10);
  // The direction of a projected tangent turns a little with the ray that it is seen along; the step leaves that out.
  EXPECT_LT((numeric - analytic).norm(), 0.05 * analytic.norm());
}

// A comb across the beam: teeth 4 mm apart, each 30 mm long, on a trunk that runs to the right.
VesselTree comb() {
  constexpr int kTeeth = 20, kPoints = 31;
  Eigen::Matrix3Xd points(3, kTeeth * kPoints);
  std::vector<int> parents;
  for (int tooth = 0; tooth < kTeeth; ++tooth) {
    for (int k = 0; k < kPoints; ++k) {
      points.col(tooth * kPoints + k) << 4e-3 * tooth, 1e-3 * k, 0;
      parents.push_back(k > 0 ? tooth * kPoints + k - 1 : (tooth - 1) * kPoints);
    }
  }
  parents[0] = -1;
  return {points, parents};
}

// The field of an image lacks what lies beyond the border. Of deformed brains of which half was in view it drew vessels
// into the view by up to 80 px, where it met others.
TEST(DeformationEquations, TheBorderOfTheViewDoesNotPullInwards) {
  const VesselTree tree = comb();
  const OrientedKernelSettings settings;
  const OrientedModel model(tree, settings);
  const XrayCamera camera = test::clinicalCamera();
  const Pose T_centered(Eigen::Translation3d(0, 0, 0.75));
  const Centerline2d all = projectedCenterline(tree, camera, T_centered * Eigen::Translation3d(-model.centroid));
  const double border_px = camera.parameters().cx_px;  // The middle of a gap.
  std::vector<bool> left;
  for (int j = 0; j < all.size(); ++j) left.push_back(all.points_px(0, j) < border_px);
  const Centerline2d seen = pointsWhere(all, left);
  OrientedFrame frame;
  const XrayViews views{
      {seen, camera, Pose::Identity(), {{0, 0}, {border_px, 0}, {border_px, 1e3}, {0, 1e3}}, nullptr}};
  frame.begin(views, settings);
  const DeformationNodes nodes(model, 10e-3);
  for (const int scale : {0, 1}) {
    // Of the last two teeth before the border, to the right.
    const auto pull = [&](const std::vector<HalfPlane>& in_view) {
      DeformationEquations<3> data(nodes, Eigen::Matrix3d::Identity());
      data.addFieldPull({camera, T_centered, model.points}, model, frame.field(0, scale), in_view, PullWeight(), 1, 1);
      double sum = 0;
      for (int n = 0; n < nodes.size(); ++n) {
        if (nodes.points(0, n) > -8e-3 && nodes.points(0, n) < 0) sum -= data.pull[static_cast<std::size_t>(n)].x();
      }
      return sum;
    };
    const double without_border = pull({});
    EXPECT_LT(without_border, -1000);
    EXPECT_LT(std::abs(pull(frame.fieldOfView(0))), 0.3 * std::abs(without_border));
  }
}

TEST(DeformationSolver, SolvesTheDenseSystemOfPoseAndModes) {
  DeformedScene s;
  const DeformationNodes nodes(s.model, 10e-3);
  const DeformationEquations<3> data = someEquations(nodes, s.random);
  const Eigen::MatrixXd modes = smoothModes(nodes.points, 4e-3, 60e-3, 24);
  const auto K = static_cast<int>(modes.cols());
  Eigen::Matrix3Xd w(3, K);
  for (int k = 0; k < K; ++k) w.col(k) = s.random.vector(1);
  Matrix6d H_pose = data.H;
  H_pose.diagonal().array() += 1e4;
  const auto step = data.solveModes(modes, w, H_pose, data.g);
  ASSERT_TRUE(step);

  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(6 + 3 * nodes.size(), 6 + 3 * K);  // From unknowns to pose and nodes.
  B.topLeftCorner<6, 6>().setIdentity();
  for (int n = 0; n < nodes.size(); ++n) {
    for (int a = 0; a < 3; ++a) B.block(6 + 3 * n + a, 6 + a * K, 1, K) = modes.row(n);
  }
  const Dense dense = denseOf(data, nodes);
  Eigen::MatrixXd H = B.transpose() * dense.H * B;
  Eigen::VectorXd g = B.transpose() * dense.g;
  H.diagonal().head<6>().array() += 1e4;
  H.diagonal().tail(3 * K).array() += 1;
  for (int a = 0; a < 3; ++a) g.segment(6 + a * K, K) += w.row(a).transpose();
  const Eigen::VectorXd x = -solveSymmetric(H, g);
  EXPECT_LT((step->dx - x.head<6>()).norm(), 1e-8 * x.head<6>().norm());  // Condition numbers near 1e6.
  for (int a = 0; a < 3; ++a)
    EXPECT_LT((step->change.row(a).transpose() - x.segment(6 + a * K, K)).norm(), 1e-8 * x.norm());
}

TEST(DeformationSolver, EliminatesTheTreeExactly) {
  DeformedScene s;
  const DeformationNodes nodes(s.model, 10e-3);
  const DeformationEquations<3> data = someEquations(nodes, s.random);
  const ChainPrior prior(nodes, 0.3e-3, 20e-3);
  const Eigen::Matrix3Xd e = 0.3 * someNodes(nodes, s.random);
  const auto step = data.solveChain(prior, e);
  const int n = 3 * nodes.size();
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < nodes.size(); ++k)
    P.block<3, 3>(3 * k, 3 * k).diagonal().array() += prior.own[static_cast<std::size_t>(k)];
  for (std::size_t k = 0; k < nodes.edges.size(); ++k) {
    const auto [a, b] = nodes.edges[k];
    P.block<3, 3>(3 * a, 3 * b).diagonal().array() += prior.along[k];
    P.block<3, 3>(3 * b, 3 * a).diagonal().array() += prior.along[k];
  }
  const Dense dense = denseOf(data, nodes);
  const Eigen::Map<const Eigen::VectorXd> e_flat(e.data(), n);
  const Eigen::VectorXd x = -solveSymmetric(Eigen::MatrixXd(dense.H.bottomRightCorner(n, n) + P),
                                            Eigen::VectorXd(dense.g.tail(n) + P * e_flat));
  EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(step.change.data(), n) - x).norm(), 1e-9 * x.norm());

  // The prior is the one that is promised: its covariance falls off with the way along the vessel.
  const Eigen::MatrixXd covariance = inverseOfSymmetric(P);
  const auto [a, b] = nodes.edges.front();
  const double distance = (nodes.points.col(a) - nodes.points.col(b)).norm();
  EXPECT_NEAR(covariance(3 * a, 3 * b), 0.09e-6 * std::exp(-distance / 20e-3), 1e-12);
  EXPECT_NEAR(covariance(n - 1, n - 1), 0.09e-6, 1e-12);
}

TEST(DeformationModes, HaveThePromisedCovariance) {
  const DeformedScene s;
  const DeformationNodes nodes(s.model, 10e-3);
  const Eigen::MatrixXd modes = smoothModes(nodes.points, 4e-3, 60e-3, 300);
  for (const int i : {0, 7, nodes.size() - 1}) {
    const double d = (nodes.points.col(i) - nodes.points.col(3)).norm() / 60e-3;
    // A thousandth of the variance may be left out.
    EXPECT_NEAR(modes.row(i).dot(modes.row(3)), 16e-6 * (1 + d + d * d / 3) * std::exp(-d), 1e-3 * 16e-6);
  }
}

TEST(DeformationFit, FindsASmoothDeformation) {
  for (const auto detail : {DeformationDetail::kLowRank, DeformationDetail::kFull}) {
    DeformedScene s;
    const Eigen::Matrix3Xd truth = wave(s.tree, 2e-3);
    s.show(truth);
    DeformationSettings settings;
    settings.detail = detail;
    DeformationFit fit(s.model, settings);
    DeformationFit::Result nothing;
    nothing.T_camera_centered = s.T_centered * expSE3(s.random.twist(1e-3, 0.01));
    nothing.displacements_m = Eigen::Matrix3Xd::Zero(3, s.model.size());
    const auto result = fit.fit(s.frame, s.belief(), nothing.T_camera_centered);
    EXPECT_GT(s.projectionError(nothing, truth), 8);
    // A quarter of a millimetre is 1.2 px: what moves along a vessel, and the ends of vessels most, is seen by its
    // neighbours only.
    EXPECT_LT(s.projectionError(result, truth), 1.3);
    // One view says little of the beam's direction, and the fit knows that.
    ASSERT_TRUE(result.posterior);
    const Eigen::Vector3d beam = result.T_camera_centered.linear().row(2);
    const Eigen::Matrix3d C = result.posterior->pointCovariance(Eigen::Vector3d::Zero());
    EXPECT_GT(std::sqrt(beam.dot(C * beam)), 1.5e-3);
    EXPECT_LT(std::sqrt((C.trace() - beam.dot(C * beam)) / 2), 0.5e-3);
  }
}

// Besides a large smooth deformation one over short lengths, which the posterior of one view smooths away.
TEST(DeformationFit, RefinesLargeDeformationsAcrossTheBeamOnly) {
  DeformedScene s;
  Eigen::Matrix3Xd truth = wave(s.tree, 2e-3);
  const Eigen::Matrix3Xd centered = s.tree.points().colwise() - s.model.centroid;
  for (Eigen::Index i = 0; i < truth.cols(); ++i) {
    truth.col(i) += 0.8e-3 * (centered.col(i) / 9e-3).array().sin().matrix();
  }
  s.show(truth);
  DeformationFit fit(s.model, {});
  const auto result = fit.fit(s.frame, s.belief(), s.T_centered);
  ASSERT_TRUE(result.posterior);
  ASSERT_GT(result.posterior->amplitude_m(), 2.5e-3);
  DeformationFit::Result smooth = result;
  smooth.displacements_m = result.posterior->displacements(s.model.points);
  EXPECT_LT(s.projectionError(result, truth), 0.85 * s.projectionError(smooth, truth));
  const Eigen::Matrix3Xd change_m =
      result.T_camera_centered.linear() * (result.displacements_m - smooth.displacements_m);
  EXPECT_GT(change_m.topRows<2>().cwiseAbs().maxCoeff(), 0.5e-3);
  EXPECT_LT(change_m.row(2).cwiseAbs().maxCoeff(), 0.05e-3);  // The fit's displacements are linear between its nodes.
}

TEST(DeformationFit, FindsNoneWhereThereIsNone) {
  for (const double noise_px : {0.0, 1.0}) {
    DeformedScene s;
    const Eigen::Matrix3Xd none = Eigen::Matrix3Xd::Zero(3, s.tree.size());
    s.show(none, 1, noise_px);
    DeformationFit fit(s.model, {});
    const auto result = fit.fit(s.frame, s.belief(), s.T_centered);
    EXPECT_LT(s.projectionError(result, none), noise_px > 0 ? noise_px : 0.1);  // Never more than the noise itself.
  }
}

TEST(DeformationFit, DoesNotMindTheOrderOfPoints) {
  DeformedScene s;
  const int n = s.tree.size();
  Eigen::Matrix3Xd points(3, n);
  std::vector<int> parents(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {  // Children before their parents.
    points.col(n - 1 - i) = s.tree.points().col(i);
    const int parent = s.tree.parents()[static_cast<std::size_t>(i)];
    parents[static_cast<std::size_t>(n - 1 - i)] = parent < 0 ? -1 : n - 1 - parent;
  }
  s.show(wave(s.tree, 2e-3));
  const auto result = DeformationFit(s.model, {}).fit(s.frame, s.belief(), s.T_centered);
  const OrientedModel turned(VesselTree(points, parents), s.settings);
  const auto other = DeformationFit(turned, {}).fit(s.frame, s.belief(), s.T_centered);
  const auto at = [&](const OrientedModel& model, const DeformationFit::Result& r, int i) {
    const auto& place = model.resampled.place_of_original[static_cast<std::size_t>(i)];
    const Eigen::Matrix3Xd moved = r.T_camera_centered * Eigen::Matrix3Xd(model.points + r.displacements_m);
    return Eigen::Vector3d((1 - place.weight) * moved.col(place.a) + place.weight * moved.col(place.b));
  };
  // Sums in another order are off in the last digits of single precision, which iterations carry on.
  for (int i = 0; i < n; i += 50) EXPECT_LT((at(s.model, result, i) - at(turned, other, n - 1 - i)).norm(), 0.1e-3);
}

TEST(DeformationFit, SeesAlongTheBeamWithTwoViews) {
  DeformedScene s;
  const Eigen::Matrix3Xd truth = wave(s.tree, 2e-3);
  s.show(truth, 2);
  DeformationFit fit(s.model, {});
  const auto result = fit.fit(s.frame, s.belief(), s.T_centered);
  const Eigen::Matrix3Xd found = s.ofGivenPoints(result.displacements_m);
  const Eigen::Matrix3Xd centered = s.tree.points().colwise() - s.model.centroid;
  const Eigen::Matrix3Xd error =
      result.T_camera_centered * Eigen::Matrix3Xd(centered + found) - s.T * Eigen::Matrix3Xd(s.tree.points() + truth);
  const double depth_rms_m = std::sqrt(error.row(2).squaredNorm() / s.tree.size());
  const double depth_moved_m = std::sqrt(((s.T.linear() * truth).row(2)).squaredNorm() / s.tree.size());
  EXPECT_GT(depth_moved_m, 1e-3);
  EXPECT_LT(depth_rms_m, 0.2e-3);  // A pixel is 0.19 mm at the tree.
}

// Groups of image points along a bent vessel: displacement and gradient change together within each of them.
TEST(ResidualGroups, OfSeveralViewsSeeTheDisplacementOfTheirMeanPlace) {
  DeformedScene s;
  const double size_m = 8e-3;
  s.show(wave(s.tree, size_m), 2);
  const Eigen::Vector3d off = s.model.centroid - s.tree.centroid();
  const Eigen::Matrix3Xd displaced = s.model.points + wave(s.model.points.colwise() + off, size_m);
  const auto offRms_px = [&](const registration::Grouping& grouping) {
    std::vector<registration::LineMatches> matches(2);
    std::vector<registration::MatchedView> matched;
    for (std::size_t v = 0; v < 2; ++v) {
      const Pose T = s.views[v].T_view_first * s.T_centered;
      registration::ProjectedEdges edges;
      edges.project(displaced, s.model.edges, s.camera, T);
      registration::matchLines(s.frame.points(v), edges, 3, registration::kMinCos2, matches[v]);
      matched.push_back({s.camera, T, s.frame.points(v), matches[v]});
    }
    const auto groups = registration::residualGroups(matched, s.model, displaced, 1, grouping);
    double squares = 0;
    for (const auto& group : groups) {
      const Eigen::Vector3d there = wave(group.at + off, size_m);
      squares += std::pow(group.residual_px + group.gradient.dot(there), 2);
    }
    return std::sqrt(squares / static_cast<double>(groups.size()));
  };
  const double fine_px = offRms_px(registration::kViewsGroups), coarse_px = offRms_px(registration::kOneViewGroups);
  // Without noise only what changes within a group is left: 0.005 and 0.041 px.
  EXPECT_LT(fine_px, 0.01);
  EXPECT_LT(3 * fine_px, coarse_px);
}

TEST(DeformationFit, RefusesSettingsOutOfRange) {
  const DeformedScene s;
  DeformationSettings settings;
  settings.length_mm = -1;
  EXPECT_THROW(DeformationFit(s.model, settings), InputError);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "field_step.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "field_search.hpp"
#include "oriented_frame.hpp"

namespace angio::test {
namespace {

// A tree, an image of it, and a pose that is off by some pixels.
struct FieldScene {
  OrientedKernelSettings settings;
  VesselTree tree;
  XrayCamera camera = test::clinicalCamera();
  Pose truth, off;
  Centerline2d image;
  OrientedModel model;

  explicit FieldScene(unsigned seed) : tree(test::branchingTree(seed)), model(tree, settings) {
    test::Random random(seed + 60);
    truth = test::viewOf(tree, random);
    Twist by;
    by << 1.5e-3 * random.direction(), degToRad(0.7) * random.direction();
    off = test::perturbed(truth, tree, by) * Eigen::Translation3d(tree.centroid());
    image = projectedCenterline(tree, camera, truth);
  }

  FieldSums sample(const KernelField& field, const Pose& T, const PullWeight& weight) const {
    std::vector<HalfPlane> view;
    fieldOfView(XrayView{image, camera}, view);
    return sampleField(model.all, field, camera, view, T, weight);
  }
};

KernelField fieldOf(const FieldScene& s, double scale) {
  OrientedPoints points;
  orientedPoints(s.image, 2, 10000, points);
  KernelField field;
  field.build(points, scale, KernelField::Region::detector(s.camera.width_px(), s.camera.height_px()));
  return field;
}

// The points' log-likelihood, relative to no vessel: weight * log(1 + F / outlier mass) of each that is in view.
double objectiveOf(const ModelPoints& model, const FieldScene& s, const KernelField& field, const Pose& T,
                   const PullWeight& pull) {
  double sum = 0;
  for (int i = 0; i < model.count; ++i) {
    const Eigen::Vector3d p = T * Eigen::Vector3d(model.x[i], model.y[i], model.z[i]);
    const Eigen::Vector3d t = T.linear() * Eigen::Vector3d(model.tx[i], model.ty[i], model.tz[i]);
    const auto pixel = s.camera.project(p);
    if (!pixel || !s.camera.sees(*pixel)) continue;
    const double du = t.x() - p.x() / p.z() * t.z(), dv = t.y() - p.y() / p.z() * t.z();
    const double length2 = std::max(1e-12, du * du + dv * dv), length = std::min(1.0, std::sqrt(length2));
    const double cos2 = (du * du - dv * dv) / length2 * length, sin2 = 2 * du * dv / length2 * length;
    sum += model.weight[i] * length * std::log(1 + std::max(0.0, field.at(*pixel, cos2, sin2).F) / pull.outlier_mass);
  }
  return sum;
}

TEST(FieldStep, GradientIsThatOfTheObjective) {
  const FieldScene s(1);
  const KernelField field = fieldOf(s, 32);
  PullWeight weight;
  // A step is linear in how the points move, their directions held: so do these. Half a pixel is beyond single
  // precision and short of a cell, whose edges the numeric derivative sees.
  const auto movedBy = [&](const Twist& by) {
    const Eigen::Matrix3Xd moved = expSE3(by) * s.model.points;
    return ModelPoints::of(moved, s.model.resampled.tree.tangents(), Eigen::VectorXd::Ones(moved.cols()), 1);
  };
  const auto objectiveMovedBy = [&](const Twist& by) { return objectiveOf(movedBy(by), s, field, s.off, weight); };
  std::vector<HalfPlane> view;
  fieldOfView(XrayView{s.image, s.camera}, view);
  const Vector6d g = sampleField(movedBy(Twist::Zero()), field, s.camera, view, s.off, weight).g;
  for (int k = 0; k < 6; ++k) {
    const double h = k < 3 ? 1e-4 : 2e-3;
    Twist by = Twist::Zero();
    by[k] = h;
    const double numeric = (objectiveMovedBy(by) - objectiveMovedBy(-by)) / (2 * h);
    const double unit = k < 3 ? g.head<3>().norm() : g.tail<3>().norm();
    EXPECT_NEAR(numeric, g[k], 0.05 * unit) << k;
  }
}

// With the majoriser's full stiffness a step is the exact all-pairs re-weighted one: none may lower the objective.
TEST(FieldStep, StepsNeverLowerTheObjective) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    const FieldScene s(seed);
    for (const double scale : {32.0, 16.0, 8.0}) {
      const KernelField field = fieldOf(s, scale);
      PullWeight weight;
      Pose T = s.off;
      const double first = objectiveOf(s.model.all, s, field, T, weight);
      double objective = first;
      for (int step = 0; step < 8; ++step) {
        const FieldSums sums = s.sample(field, T, weight);
        T = T * expSE3(solveSymmetric(sums.H, sums.g));
        const double before = objective;
        objective = objectiveOf(s.model.all, s, field, T, weight);
        // Bilinear cells are not Gaussians to the last digit: at rest the objective may waver by a thousandth.
        EXPECT_GT(objective, before - 1e-3 * std::abs(before)) << scale << " px, step " << step;
      }
      EXPECT_GT(objective, first);
    }
  }
}

TEST(FieldStep, IsTheSameOnEveryVectorTarget) {
  const FieldScene s(2);
  const KernelField field = fieldOf(s, 16);
  const FieldSums widest = s.sample(field, s.off, {});
  const auto targets = fieldStepTargets();
  ASSERT_GE(targets.size(), 1u);
  for (const auto target : targets) {
    useFieldStepTarget(target);
    const FieldSums sums = s.sample(field, s.off, {});
    // Single precision, and sums of some hundred points in another order.
    EXPECT_LT((sums.H - widest.H).norm(), 1e-4 * widest.H.norm());
    EXPECT_LT((sums.g - widest.g).norm(), 1e-4 * widest.g.norm() + 1e-6 * widest.H.norm());
    EXPECT_NEAR(sums.fit, widest.fit, 1e-4 * widest.fit);
    EXPECT_NEAR(sums.seen, widest.seen, 1e-4 * widest.seen);
  }
  useFieldStepTarget(0);
}

TEST(FieldStep, WhatIsOutOfTheFieldOfViewHasNoVote) {
  FieldScene s(3);
  const KernelField field = fieldOf(s, 16);
  const double all = s.sample(field, s.off, {}).seen;
  std::vector<HalfPlane> left_half;
  XrayView view{s.image, s.camera};
  view.collimator_px = {{0, 0}, {511, 0}, {511, 1023}, {0, 1023}};
  fieldOfView(view, left_half);
  const double left = sampleField(s.model.all, field, s.camera, left_half, s.off, {}).seen;
  view.collimator_px = {{0, 1023}, {511, 1023}, {511, 0}, {0, 0}};  // The other way round.
  fieldOfView(view, left_half);
  EXPECT_NEAR(sampleField(s.model.all, field, s.camera, left_half, s.off, {}).seen, left, 1e-3);
  EXPECT_LT(left, 0.9 * all);
  EXPECT_GT(left, 0.1 * all);
  Pose behind = s.off;
  behind.translation().z() = -0.5;
  EXPECT_EQ(s.sample(field, behind, {}).seen, 0);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// Certificates: bounds that hold, alternatives that are found, and no proof without one.
#include "angio/registration/certificate.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/registration/starts.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"
#include "pose_bounds.hpp"

namespace angio::test {
namespace {

struct CertificateScene {
  VesselTree tree;
  XrayCamera camera;
  Pose truth;
  Centerline2d image;

  explicit CertificateScene(unsigned seed, XrayCamera seen_by = test::clinicalCamera())
      : tree(test::branchingTree(seed)), camera(std::move(seen_by)) {
    test::Random random(seed + 500);
    truth = test::viewOf(tree, random);
    image = projectedCenterline(tree, camera, truth);
  }
  CertificateScene(VesselTree given, const Pose& T_camera_model)
      : tree(std::move(given)), camera(test::clinicalCamera()), truth(T_camera_model) {
    image = projectedCenterline(tree, camera, truth);
  }
  XrayView view() const { return {image, camera}; }
};

// A window that shows a part of the tree.
XrayCamera window() {
  XrayCamera::Parameters p = test::clinicalCamera().parameters();
  p.width_px = p.height_px = 320;
  p.cx_px -= 340;
  p.cy_px -= 350;
  return XrayCamera(p);
}

// A pose of a cell about a ray: one of its corners, or anywhere in it.
Pose drawnWithin(const PoseCell& cell, const Eigen::Vector2d& ray, double half_ray, const Pose& center, bool corner,
                 test::Random& random) {
  const auto within = [&] {
    const double at = random.uniform(-1, 1);
    return corner ? std::copysign(1.0, at) : at;
  };
  Eigen::Vector3d r = cell.rotation;
  for (int k = 0; k < 3; ++k) r[k] += within() * cell.half[k];
  const double depth = cell.depth + within() * cell.half_depth;
  const double ray_x = ray.x() + within() * half_ray, ray_y = ray.y() + within() * half_ray;
  Pose T = Pose::Identity();
  T.linear() = expSO3(r) * center.linear();
  T.translation() = depth * Eigen::Vector3d(ray_x, ray_y, 1);
  return T;
}

// Rays of equal length and equal angles in the plane z = 0, the first along x.
VesselTree star(int rays, double turn_rad, double length_m) {
  std::vector<Eigen::Vector3d> points{Eigen::Vector3d::Zero()};
  std::vector<int> parents{-1};
  for (int k = 0; k < rays; ++k) {
    const double angle = k * turn_rad;
    for (int i = 1; i <= 40; ++i) {
      parents.push_back(i == 1 ? 0 : static_cast<int>(points.size()) - 1);
      points.emplace_back(length_m * i / 40 * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
    }
  }
  Eigen::Matrix3Xd matrix(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
  return VesselTree(matrix, parents);
}

Pose inFront(const VesselTree& tree, const Eigen::Matrix3d& R) {
  Pose T = Pose::Identity();
  T.linear() = R;
  T.translation() = Eigen::Vector3d(0, 0, 0.75) - R * tree.centroid();
  return T;
}

CertificateSettings boxOf(double rotation_deg, double translation_mm) {
  CertificateSettings settings;
  settings.box_rotation_deg = rotation_deg;
  settings.box_translation_mm = translation_mm;
  settings.seconds = 200;
  settings.threads = 2;
  return settings;
}

// The law that a proof rests on: no pose of a cell has more points than the cell's bound, whatever the cell's size and
// place, with poses at its corners as well as inside.
TEST(Certificate, NoPoseOfACellExceedsItsBound) {
  int draws = 0, close = 0, pruned = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const CertificateScene s = seed % 2 == 0 ? CertificateScene(seed) : CertificateScene(seed, window());
    const TreeSamples samples(s.tree);
    const ExplainedRaster raster(s.image, s.camera);
    const Pose center = s.truth * Eigen::Translation3d(s.tree.centroid());
    PoseBounds bounds(samples, raster, s.view(), center.linear(), 1 + static_cast<int>(seed) / 2);
    test::Random random(seed + 1);
    for (int c = 0; c < 400; ++c) {
      // From cells of a tenth of a pixel to half of the box.
      const double size = std::pow(10, random.uniform(-4, 0));
      PoseCell cell;
      const double away = c % 3 == 0 ? size : random.uniform(0, 1);
      for (int k = 0; k < 3; ++k) {
        cell.rotation[k] = away * random.uniform(-0.8, 0.8);
        cell.half[k] = size * random.uniform(0, 0.5);
      }
      cell.depth = center.translation().z() + away * random.uniform(-0.06, 0.06);
      cell.half_depth = size * random.uniform(0, 0.06);
      if (c % 40 == 0) cell.depth = 0.08;  // Next to the source.
      const double half_ray = size * random.uniform(0, 0.1), spread = random.uniform(0, 0.05);
      const RayCell rays{away * random.uniform(-0.06, 0.06), away * random.uniform(-0.06, 0.06), spread};
      bounds.prepare(cell, rays, half_ray);
      const double x = rays.x + random.uniform(-spread, spread), y = rays.y + random.uniform(-spread, spread);
      const int none = -3 * bounds.maxPoints();  // All count, also those that lose more than they have.
      const int bound = bounds.pointsBound(x, y, none);
      for (int i = 0; i < 12; ++i, ++draws) {
        const Pose T = drawnWithin(cell, {x, y}, half_ray, center, i < 4, random);
        const int points = bounds.points(T, none);
        ASSERT_LE(points, bound) << "seed " << seed << ", cell " << c << " of size " << size;
        close += bound > 0 && points > bound - 24;
      }
      // Asked for more than there can be, it says so; for as much, it says how much.
      if (bound <= 0) continue;
      EXPECT_EQ(bounds.pointsBound(x, y, bound), bound);
      EXPECT_EQ(bounds.pointsBound(x, y, bound + 1), -1);
      pruned += bound < bounds.maxPoints() / 2;
    }
  }
  EXPECT_GT(draws, 20000);
  // The bounds say something: some are nearly reached, and many are far from the most.
  EXPECT_GT(close, 100);
  EXPECT_GT(pruned, 100);
}

// Vessels that run across all of an image's lines are explained by none of it. Where they may be out of view, that
// costs nothing.
TEST(Certificate, WhatMayBeAnywhereIsNotSeen) {
  const VesselTree along = star(1, 0, 0.06), across = star(2, kPi, 0.03);
  const Pose seen = inFront(along, Eigen::Matrix3d::Identity());
  const CertificateScene s(along, seen);
  const TreeSamples samples(across);
  const ExplainedRaster raster(s.image, s.camera);
  const Eigen::Matrix3d R = Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  PoseBounds bounds(samples, raster, s.view(), R);
  PoseCell cell;
  cell.half.setConstant(0.02);
  cell.depth = 0.75;
  for (const double half_ray : {0.02, 0.3}) {
    bounds.prepare(cell, {0, 0, 0}, half_ray);
    Pose away = Pose::Identity();
    away.linear() = R;
    away.translation() = 0.75 * Eigen::Vector3d(half_ray, 0, 1);
    const int none = -2 * bounds.maxPoints(), points = bounds.points(away, none);
    EXPECT_EQ(points, half_ray < 0.1 ? -bounds.maxPoints() : 0);
    EXPECT_GE(bounds.pointsBound(0, 0, none), points) << "rays within " << half_ray;
  }
}

// The same of each place by itself: a sum could hide one that is too low.
TEST(Certificate, NoPlaceIsExplainedInACellThatRulesItOut) {
  int explained = 0, ruled_out = 0;
  for (unsigned seed = 0; seed < 4; ++seed) {
    const CertificateScene s = seed % 2 == 0 ? CertificateScene(seed) : CertificateScene(seed, window());
    const TreeSamples all(s.tree);
    TreeSamples same = all;
    const ExplainedRaster raster(s.image, s.camera);
    const Pose center = s.truth * Eigen::Translation3d(s.tree.centroid());
    PoseBounds bounds(same, raster, s.view(), center.linear());
    test::Random random(seed + 50);
    for (int c = 0; c < 3000; ++c) {
      const auto one = static_cast<std::size_t>(random.uniform(0, TreeSamples::kCount - 0.01));
      same.points.colwise() = Eigen::Vector3d(all.points.col(static_cast<Eigen::Index>(one)));
      same.tangents.colwise() = Eigen::Vector3d(all.tangents.col(static_cast<Eigen::Index>(one)));
      for (const auto values : {&ModelPoints::x, &ModelPoints::y, &ModelPoints::z, &ModelPoints::tx, &ModelPoints::ty,
                                &ModelPoints::tz, &ModelPoints::weight})
        std::fill((same.floats.*values).begin(), (same.floats.*values).end(), (all.floats.*values)[one]);
      const double size = std::pow(10, random.uniform(-3, -0.5));
      PoseCell cell;
      for (int k = 0; k < 3; ++k) {
        cell.rotation[k] = random.uniform(-0.5, 0.5);
        cell.half[k] = size * random.uniform(0, 0.5);
      }
      cell.depth = center.translation().z() + random.uniform(-0.06, 0.06);
      cell.half_depth = size * random.uniform(0, 0.06);
      const double half_ray = size * random.uniform(0, 0.05);
      const double x = random.uniform(-0.03, 0.03), y = random.uniform(-0.03, 0.03);
      bounds.prepare(cell, {x, y, 0}, half_ray);
      const int none = -bounds.maxPoints(), bound = bounds.pointsBound(x, y, none);
      ruled_out += bound < bounds.maxPoints();
      for (int i = 0; i < 24; ++i) {
        const Pose T = drawnWithin(cell, {x, y}, half_ray, center, i < 16, random);
        const int points = bounds.points(T, none);
        ASSERT_LE(points, bound) << "seed " << seed << ", cell " << c << " of size " << size;
        explained += points > 0;
      }
    }
  }
  EXPECT_GT(explained, 2000);
  EXPECT_GT(ruled_out, 1000);
}

TEST(Certificate, AWordHoldsAllDirectionsWithinItsRadius) {
  const CertificateScene s(3);
  const ExplainedRaster raster(s.image, s.camera);
  const auto& levels = raster.levels();
  const auto wordAt = [&](int k, double u, double v) {
    const auto place = [&](double px, double last) {
      return static_cast<int>(std::clamp((px + ExplainedRaster::kBefore_px) * levels.inverse_cell_px[k], 0.0, last));
    };
    return raster
        .words()[levels.first[k] + place(v, levels.last_row[k]) * levels.columns[k] + place(u, levels.last_column[k])];
  };
  test::Random random(1);
  for (int k = 0; k < ExplainedRaster::kLevels; ++k) {
    ASSERT_TRUE(levels.radius_px[k] == 0 || k + 1 == ExplainedRaster::kLevels || levels.radius_px[k] >= 1);
    const double radius = std::min(300.0f, levels.radius_px[k]);
    int bits = 0;
    for (int i = 0; i < 4000; ++i) {
      const double u = random.uniform(-200, 1224), v = random.uniform(-200, 1224);
      const auto there = wordAt(0, u + random.uniform(-radius, radius), v + random.uniform(-radius, radius));
      ASSERT_EQ(there & ~wordAt(k, u, v), 0u) << levels.radius_px[k] << " px at " << u << ", " << v;
      bits += there != 0;
    }
    EXPECT_GT(bits, 20);
  }
}

TEST(Certificate, ProvesThatNoOtherPoseScoresNearlyAsWell) {
  for (const unsigned seed : {1u, 2u}) {
    const CertificateScene s(seed);
    const Pose middle = drawnPose(s.truth, s.tree.centroid(), degToRad(4), 4e-3, 1, static_cast<int>(seed));
    double last_share = 0, last_bound = 0;
    const auto certificate = certify(s.tree, s.view(), middle, s.truth, boxOf(25, 30), [&](double share, double bound) {
      EXPECT_GE(share, last_share);
      last_share = share;
      last_bound = bound;
    });
    EXPECT_TRUE(certificate.proven) << certificate.reason;
    EXPECT_EQ(certificate.reason, "");
    EXPECT_FALSE(certificate.alternative);
    EXPECT_LT(certificate.bound, 0.9);
    EXPECT_GT(certificate.score, 0.8);
    EXPECT_EQ(certificate.unexplained_cost, 3);  // Nearly all of it is explained.
    EXPECT_DOUBLE_EQ(certificate.score, certifiedScore(s.tree, s.view(), s.truth, certificate.unexplained_cost));
    EXPECT_GT(certificate.cells, 1000);
    // What it says of all poses holds for those that one can draw.
    for (int i = 0; i < 40; ++i) {
      StartSettings box;
      box.box_rotation_deg = 25;
      box.box_translation_mm = 30;
      const Pose other = drawnStart({middle, {}}, s.tree.centroid(), box, i);
      if (poseDistance_m(s.tree, s.truth, other) > 5e-3) {
        EXPECT_LE(certifiedScore(s.tree, s.view(), other, certificate.unexplained_cost),
                  certificate.bound * certificate.score);
      }
    }
  }
}

// What is not explained costs as much as leaves the found pose half of the points of what is; from an image without
// branches it costs less than from a whole one.
TEST(Certificate, UnexplainedPlacesCostWhatTheFoundPoseCanBear) {
  const CertificateScene s(3);
  std::vector<bool> costs(4, false);
  for (double missing = 0; missing < 0.5; missing += 0.04) {
    std::vector<bool> keep(static_cast<std::size_t>(s.image.size()));
    for (int i = 0; i < s.image.size(); ++i) keep[static_cast<std::size_t>(i)] = i >= missing * s.image.size();
    const XrayView view{pointsWhere(s.image, keep), s.camera};
    const auto score = [&](int cost) { return certifiedScore(s.tree, view, s.truth, cost); };
    auto settings = boxOf(1, 1);
    settings.seconds = 0;
    const int cost = certify(s.tree, view, s.truth, s.truth, settings).unexplained_cost;
    ASSERT_TRUE(cost >= 1 && cost <= 3) << cost;
    costs[static_cast<std::size_t>(cost)] = true;
    if (cost > 1) {
      EXPECT_GE(2 * score(cost), score(0)) << missing;
    }
    if (cost < 3) {
      EXPECT_LT(2 * score(cost + 1), score(0)) << missing;
    }
  }
  EXPECT_TRUE(costs[1] && costs[2] && costs[3]);
}

TEST(Certificate, OneThreadAndTwoProveTheSame) {
  const CertificateScene s(4);
  auto settings = boxOf(15, 15);
  settings.threads = 1;
  const auto one = certify(s.tree, s.view(), s.truth, s.truth, settings);
  settings.threads = 2;
  const auto two = certify(s.tree, s.view(), s.truth, s.truth, settings);
  EXPECT_TRUE(one.proven);
  EXPECT_TRUE(two.proven);
  EXPECT_EQ(one.bound, two.bound);
}

// A wrong pose is never certified: the true one is its alternative.
TEST(Certificate, AWrongPoseHasTheTrueOneForAnAlternative) {
  for (const unsigned seed : {5u, 6u, 7u}) {
    const CertificateScene s(seed);
    Twist off;
    off << 4e-3, -5e-3, 0, 0.05, -0.08, 0.1;
    const Pose wrong = test::perturbed(s.truth, s.tree, off);
    const auto certificate = certify(s.tree, s.view(), s.truth, wrong, boxOf(25, 30));
    EXPECT_FALSE(certificate.proven);
    if (certificate.score == 0) continue;  // It explains nothing.
    ASSERT_TRUE(certificate.alternative) << certificate.reason;
    EXPECT_GE(certificate.alternative->share, 0.9);
    EXPECT_GT(certificate.alternative->distance_m, 5e-3);
  }
}

// What looks the same from several sides is never certified, and the other side is named.
TEST(Certificate, ASymmetricTreeHasAnAlternativeThatIsReturned) {
  const VesselTree tree = star(12, kPi / 6, 0.05);  // The same when turned by 30 deg.
  const CertificateScene s(tree, inFront(tree, expSO3({0.3, 0.2, 0})));
  const auto certificate = certify(s.tree, s.view(), s.truth, s.truth, boxOf(45, 60));
  EXPECT_FALSE(certificate.proven);
  ASSERT_TRUE(certificate.alternative) << certificate.reason;
  EXPECT_GE(certificate.alternative->share, 0.9);
  EXPECT_NEAR(certificate.alternative->share,
              certifiedScore(s.tree, s.view(), certificate.alternative->T_camera_model, certificate.unexplained_cost) /
                  certificate.score,
              1e-12);
  EXPECT_NEAR(certificate.alternative->distance_m,
              poseDistance_m(s.tree, s.truth, certificate.alternative->T_camera_model), 1e-9);
  EXPECT_GT(certificate.alternative->distance_m, 5e-3);
}

// A flat tree looks nearly the same with near and far exchanged.
TEST(Certificate, AFlatTreeHasItsDepthMirrorForAnAlternative) {
  const VesselTree tree = star(5, 1.1, 0.03);
  const CertificateScene s(tree, inFront(tree, expSO3({0.35, 0, 0})));
  const auto certificate = certify(s.tree, s.view(), s.truth, s.truth, boxOf(45, 20));
  EXPECT_FALSE(certificate.proven);
  ASSERT_TRUE(certificate.alternative) << certificate.reason;
  EXPECT_GE(certificate.alternative->share, 0.9);
  // Tilted to the other side.
  const Eigen::Vector3d normal = certificate.alternative->T_camera_model.linear().col(2);
  EXPECT_LT(normal.y() * s.truth.linear().col(2).y(), 0);
}

TEST(Certificate, WithoutTimeNothingIsProven) {
  const CertificateScene s(8);
  auto settings = boxOf(45, 60);
  for (const double seconds : {0.0, 0.005}) {
    settings.seconds = seconds;
    const auto certificate = certify(s.tree, s.view(), s.truth, s.truth, settings);
    EXPECT_FALSE(certificate.proven);
    EXPECT_FALSE(certificate.alternative);
    EXPECT_GE(certificate.bound, 0.9);
    EXPECT_EQ(certificate.reason.rfind("not proven: bound ", 0), 0u) << certificate.reason;
    EXPECT_LT(certificate.seconds, seconds + 1);
  }
}

TEST(Certificate, DepthIsNoDistance) {
  const CertificateScene s(9);
  Pose deeper = s.truth;
  const Eigen::Vector3d center = s.truth * s.tree.centroid();
  deeper.translation() += 0.02 * center / center.z();
  EXPECT_NEAR(poseDistance_m(s.tree, s.truth, deeper), 0, 1e-9);
  Pose beside = s.truth;
  beside.translation().x() += 7e-3;
  EXPECT_NEAR(poseDistance_m(s.tree, s.truth, beside), 7e-3, 1e-9);
}

TEST(Certificate, AnImageThatExplainsNothingProvesNothing) {
  const CertificateScene s(10);
  Pose behind = s.truth;
  behind.translation().z() -= 2;
  for (const Pose& found : {behind, Pose(s.truth * Eigen::Translation3d(0.5, 0, 0))}) {
    const auto certificate = certify(s.tree, s.view(), s.truth, found, boxOf(10, 10));
    EXPECT_FALSE(certificate.proven);
    EXPECT_NE(certificate.reason, "");
  }
}

TEST(Certificate, RefusesSettingsOutOfTheirRange) {
  const CertificateScene s(11);
  auto settings = boxOf(10, 10);
  settings.alternative_share = 0;
  EXPECT_THROW(certify(s.tree, s.view(), s.truth, s.truth, settings), InputError);
}

}  // namespace
}  // namespace angio::test

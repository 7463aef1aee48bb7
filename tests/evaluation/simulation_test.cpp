// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/evaluation/simulation.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <set>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/resample.hpp"

namespace angio::test {
namespace {

// Between projected points 0.25 mm apart a bent vessel leaves its chord by far less than this.
constexpr double kChord_px = 0.2;

class Simulations : public testing::Test {
 protected:
  SimulatedTrial trial(int index = 3) const { return simulatedTrial(tree_, {}, settings_, index); }

  // The true tree in one view, as the view's camera sees it, finely sampled.
  Eigen::Matrix2Xd projected(const SimulatedTrial& t, std::size_t view) const {
    const VesselTree fine = resampled(tree_, 0.05e-3, 1000000).tree;
    Eigen::Matrix2Xd pixels(2, fine.size());
    for (int i = 0; i < fine.size(); ++i) {
      pixels.col(i) = *t.cameras[view].project(t.T_view_first[view] * t.truth * fine.points().col(i));
    }
    return pixels;
  }
  static double nearest(const Eigen::Matrix2Xd& to, const Eigen::Vector2d& from) {
    return (to.colwise() - from).colwise().norm().minCoeff();
  }
  static double lengthOf(const Centerline2d& c) {
    double sum = 0;
    for (int i = 1; i < c.size(); ++i) {
      if (c.branch[i] == c.branch[i - 1]) sum += (c.points_px.col(i) - c.points_px.col(i - 1)).norm();
    }
    return sum;
  }

  VesselTree tree_ = test::branchingTree(6, {0.02, -0.01, 0.03});
  SimulationSettings settings_;
};

TEST_F(Simulations, ACleanImageShowsTheTreeAtItsTruth) {
  settings_.views = 2;
  const SimulatedTrial t = trial();
  ASSERT_EQ(t.centerlines.size(), 2u);
  EXPECT_TRUE(t.T_view_first[0].isApprox(Pose::Identity()));
  for (std::size_t v = 0; v < 2; ++v) {
    const Eigen::Matrix2Xd true_pixels = projected(t, v);
    ASSERT_GT(t.centerlines[v].size(), 500);
    for (int i = 0; i < t.centerlines[v].size(); i += 7) {
      EXPECT_LT(nearest(true_pixels, t.centerlines[v].points_px.col(i)), kChord_px) << "view " << v << ", point " << i;
    }
  }
  EXPECT_NEAR((t.truth * tree_.centroid() - Eigen::Vector3d(0, 0, 0.75)).norm(), 0, 1e-12);
  const double between_deg = radToDeg(std::acos(t.T_view_first[1].linear()(2, 2)));
  EXPECT_GE(between_deg, 70);
  EXPECT_LE(between_deg, 110);
  EXPECT_NEAR((t.T_view_first[1] * t.truth * tree_.centroid() - Eigen::Vector3d(0, 0, 0.75)).norm(), 0, 1e-12);
}

// mt19937_64 and seed_seq are fixed by the standard, and so are these numbers, up to a mathematical library's last
// digits.
TEST_F(Simulations, ATrialIsTheSameAgainAndOthersAreNot) {
  settings_.noise_px = 1;
  settings_.spurious = 3;
  settings_.visible_fraction = 0.6;
  const SimulatedTrial a = trial(5), b = trial(5), c = trial(6);
  EXPECT_EQ(a.truth.matrix(), b.truth.matrix());
  EXPECT_EQ(a.start.matrix(), b.start.matrix());
  EXPECT_EQ(a.centerlines[0].points_px, b.centerlines[0].points_px);
  EXPECT_FALSE(a.truth.isApprox(c.truth, 1e-3));
  settings_.seed = 2;
  EXPECT_FALSE(a.truth.isApprox(trial(5).truth, 1e-3));
}

TEST_F(Simulations, OneSettingLeavesTheOthersDraws) {
  const SimulatedTrial clean = trial();
  settings_.noise_px = 2;
  settings_.spurious = 4;
  settings_.missing = 0.3;
  settings_.visible_fraction = 0.5;
  settings_.deformation_rms_mm = 3;
  const SimulatedTrial spoilt = trial();
  EXPECT_EQ(clean.truth.matrix(), spoilt.truth.matrix());
  EXPECT_EQ(clean.start.matrix(), spoilt.start.matrix());
}

TEST_F(Simulations, TheFieldOfViewShowsTheShareAskedFor) {
  for (const double share : {0.75, 0.5, 0.3}) {
    for (int i = 0; i < 5; ++i) {
      settings_.visible_fraction = 1;
      const double all_px = lengthOf(trial(i).centerlines[0]);
      settings_.visible_fraction = share;
      const SimulatedTrial t = trial(i);
      // Two per cent as promised, and half a per cent for what resampling cuts from bends.
      EXPECT_NEAR(lengthOf(t.centerlines[0]) / all_px, share, 0.025) << "trial " << i;
      EXPECT_LT(t.cameras[0].width_px(), 1024);
      for (int k = 0; k < t.centerlines[0].size(); ++k) {
        ASSERT_TRUE(t.cameras[0].sees(t.centerlines[0].points_px.col(k)));
      }
      EXPECT_LT(nearest(projected(t, 0), t.centerlines[0].points_px.col(9)), kChord_px)
          << "the cropped camera projects there";
    }
  }
}

TEST_F(Simulations, NoiseIsOfTheSizeAskedFor) {
  settings_.spacing_px = 0;
  const Centerline2d clean = trial().centerlines[0];
  settings_.noise_px = 1.5;
  const Centerline2d noisy = trial().centerlines[0];
  ASSERT_EQ(clean.size(), noisy.size());
  // Some 2,000 draws or more: their standard deviation is known to 2 %, three times that is safe.
  const double rms_px = std::sqrt((noisy.points_px - clean.points_px).squaredNorm() / (2.0 * clean.size()));
  ASSERT_GT(clean.size(), 1000);
  EXPECT_NEAR(rms_px, 1.5, 0.1);
}

TEST_F(Simulations, MissingBranchesAreMissingInBothViews) {
  settings_.views = 2;
  const SimulatedTrial all = trial();
  settings_.missing = 0.4;
  const SimulatedTrial some = trial();
  for (std::size_t v = 0; v < 2; ++v) {
    EXPECT_LT(some.centerlines[v].size(), 0.75 * all.centerlines[v].size());
    EXPECT_GT(some.centerlines[v].size(), 0.45 * all.centerlines[v].size());
  }
  const auto branches = [](const Centerline2d& c) { return std::set<int>(c.branch.begin(), c.branch.end()).size(); };
  EXPECT_EQ(branches(some.centerlines[0]), branches(some.centerlines[1]));
}

// Length-weighed share of the tree that is filled.
double filledShare(const VesselTree& tree, const Eigen::VectorXd& filled) {
  double sum_m = 0;
  for (int i = 0; i < tree.size(); ++i) {
    const int parent = tree.parents()[static_cast<std::size_t>(i)];
    if (parent >= 0 && filled[i] > 0 && filled[parent] > 0) {
      sum_m += (tree.points().col(i) - tree.points().col(parent)).norm();
    }
  }
  return sum_m / tree.length();
}

TEST_F(Simulations, WhatLiesDownstreamOfAFilledBranchIsFilled) {
  for (const double share : {0.3, 0.5, 0.8}) {
    settings_.filled = share;
    for (int i = 0; i < 10; ++i) {
      const SimulatedTrial t = trial(i);
      // As near as whole branches come: none is longer than a tenth of the tree.
      EXPECT_NEAR(filledShare(tree_, t.filled), share, 0.1) << "trial " << i;
      int leaks = 0;
      const auto& branches = tree_.branches();
      for (const auto& branch : branches) {
        const bool is_filled = branch.size() > 2 && t.filled[branch[branch.size() / 2]] > 0;
        if (!is_filled) continue;
        for (const int child : tree_.children()[static_cast<std::size_t>(branch.back())]) leaks += t.filled[child] == 0;
      }
      // Only the last site, which may fill more than is wanted, is cut short: at the ends of a few branches.
      EXPECT_LE(leaks, 4) << "share " << share << ", trial " << i;
    }
  }
}

TEST_F(Simulations, AMeasuredMotionIsCarriedOverToTheTree) {
  // A motion along z that grows with x squared, on a grid of 300 mm: bent, and known everywhere.
  MeasuredMotion motion;
  motion.points.resize(3, 1000);
  motion.displacements_m.setZero(3, 1000);
  for (int i = 0; i < 1000; ++i) {
    motion.points.col(i) = 0.03 * Eigen::Vector3d(i % 10, i / 10 % 10, i / 100);
    motion.displacements_m(2, i) = std::pow(motion.points(0, i) - 0.15, 2);
  }
  settings_.deformation_rms_mm = 3;
  const auto moved = [&](int i) { return simulatedTrial(tree_, {}, settings_, i, &motion).displacements_m; };
  const Eigen::Matrix3Xd d = moved(0);
  EXPECT_NEAR(std::sqrt(d.squaredNorm() / d.cols()), 3e-3, 1e-9);
  EXPECT_GT((d - moved(1)).norm(), 0.1 * d.norm()) << "another turn";
  // All in one direction but for the rigid part that was taken out: that turns points, by a few millimetres.
  const Eigen::Vector3d squares = eigenOfSymmetric(Eigen::Matrix3d(d * d.transpose())).values;
  EXPECT_GT(squares[2], 1.5 * 1.5 * squares[1]);
  // No pose is left in it.
  EXPECT_LT(d.rowwise().mean().norm(), 1e-6);
}

TEST_F(Simulations, WavesMayMoveMoreFromFeetToHead) {
  settings_.deformation_rms_mm = 3;
  settings_.deformation_anisotropy = 3;
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (int i = 0; i < 50; ++i) squares += trial(i).displacements_m.rowwise().squaredNorm();
  // Not 3: the rigid part takes from every axis.
  EXPECT_GT(std::sqrt(squares[2] / squares[0]), 1.5);
  EXPECT_GT(std::sqrt(squares[2] / squares[1]), 1.5);
}

TEST_F(Simulations, SpuriousCurvesAreBranchesOfTheirOwn) {
  const Centerline2d clean = trial().centerlines[0];
  settings_.spurious = 6;
  const Centerline2d spoilt = trial().centerlines[0];
  const auto vessels = clean.branch.back();
  ASSERT_EQ(spoilt.branch.back(), vessels + 6);
  EXPECT_EQ(spoilt.points_px.leftCols(clean.size()), clean.points_px);
  for (int k = vessels + 1; k <= vessels + 6; ++k) {
    double length_px = 0;
    for (int i = clean.size() + 1; i < spoilt.size(); ++i) {
      if (spoilt.branch[i] == k && spoilt.branch[i - 1] == k) {
        length_px += (spoilt.points_px.col(i) - spoilt.points_px.col(i - 1)).norm();
      }
    }
    EXPECT_GE(length_px, 40);  // 60 px, shortened where the detector ends.
    EXPECT_LE(length_px, 252);
  }
}

TEST_F(Simulations, ADeformationHasItsSizeAndNoRigidPart) {
  settings_.deformation_rms_mm = 4;
  settings_.spacing_px = 0;
  settings_.tree_spacing_mm = 0;
  const SimulatedTrial t = trial();
  ASSERT_EQ(t.displacements_m.cols(), tree_.size());
  EXPECT_NEAR(std::sqrt(t.displacements_m.squaredNorm() / tree_.size()), 4e-3, 1e-12);
  EXPECT_LT(t.displacements_m.rowwise().mean().norm(), 1e-12);
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (int i = 0; i < tree_.size(); ++i) {
    turn += (tree_.points().col(i) - tree_.centroid()).cross(t.displacements_m.col(i)) / tree_.size();
  }
  EXPECT_LT(turn.norm(), 1e-12);
  // The image shows the deformed tree: its first branch begins at the root.
  const Eigen::Vector3d root = tree_.points().col(0) + t.displacements_m.col(0);
  EXPECT_LT((*t.cameras[0].project(t.truth * root) - t.centerlines[0].points_px.col(0)).norm(), 1e-9);
}

TEST_F(Simulations, EvenStartsCoverTheirRange) {
  settings_.even_starts_mm = 20;
  std::vector<int> bins(4, 0);
  for (int i = 0; i < 60; ++i) {
    const SimulatedTrial t = trial(i);
    const double mtre_mm = 1e3 * ((t.start * tree_.points()) - (t.truth * tree_.points())).colwise().norm().mean();
    ASSERT_LE(mtre_mm, 20.001);
    ++bins[static_cast<std::size_t>(std::min(3.0, mtre_mm / 5))];
  }
  // Fifteen expected in each, with a standard deviation of 3.4.
  for (const int count : bins) EXPECT_GE(count, 5);
}

TEST_F(Simulations, CalibrationErrorsAreInWhatTheMethodIsTold) {
  settings_.views = 2;
  const SimulatedTrial right = trial();
  settings_.focal_error_percent = 2;
  settings_.calibration_rotation_error_deg = 1;
  settings_.calibration_translation_error_mm = 3;
  const SimulatedTrial wrong = trial();
  EXPECT_EQ(right.centerlines[0].points_px, wrong.centerlines[0].points_px) << "what is seen is the truth";
  const double ratio = wrong.cameras[0].parameters().fx_px / right.cameras[0].parameters().fx_px;
  EXPECT_NEAR(std::abs(ratio - 1), 0.02, 1e-12);
  const Pose off = wrong.T_view_first[1] * right.T_view_first[1].inverse();
  EXPECT_NEAR(radToDeg(rotationAngle(off.linear())), 1, 1e-9);
  const Eigen::Vector3d isocenter(0, 0, 0.75);
  EXPECT_NEAR((off * isocenter - isocenter).norm(), 3e-3, 1e-9);
  EXPECT_TRUE(wrong.T_view_first[0].isApprox(Pose::Identity()));
}

TEST_F(Simulations, ATinyFieldOfViewStillHasItsCurves) {
  settings_.visible_fraction = 0.02;
  settings_.spurious = 20;
  settings_.spacing_px = 100;
  const SimulatedTrial t = trial();
  EXPECT_GT(t.centerlines[0].size(), 0);
}

TEST_F(Simulations, SettingsOutOfRangeAreRefused) {
  settings_.missing = 1.5;
  EXPECT_EQ(test::refusalOf([&] { trial(); }).find("simulation: missing = 1.5"), 0u);
}

}  // namespace
}  // namespace angio::test

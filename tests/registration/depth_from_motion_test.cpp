// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/depth_from_motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {
namespace {

using registration::DepthFromMotion;
using registration::MovingFrame;

// A tree that is deformed by a few millimetres and whose patient breathes, in frames of a C-arm that stands for 4 s and
// then turns by 6 deg in one. Each is registered as a loop does: from where the one before was.
class Turn {
 public:
  Turn(unsigned seed, double deformation_m, double breath_m, double turn_deg = 6, double lag_s = 0.3)
      : random_(seed), tree_(branchingTree(seed)) {
    T_last_ = viewOf(tree_, random_);
    const Eigen::Vector3d a = random_.vector(1), b = random_.vector(1);
    deformation_.resize(3, tree_.size());
    for (int i = 0; i < tree_.size(); ++i) {
      const Eigen::Vector3d p = (tree_.points().col(i) - tree_.centroid()) / 0.05;
      deformation_.col(i) = deformation_m * Eigen::Vector3d(std::sin(2 * p.y() + a.x()), std::sin(1.5 * p.x() + a.y()),
                                                            std::sin(1.5 * p.y() + 1.5 * p.x() + b.x()));
    }
    OrientedKernelSettings settings;
    settings.deformation = Deformation::kNonrigid;
    const auto registration = registration::makeRegistration(settings, tree_);
    prior_.T_camera_model = perturbed(T_last_, tree_, (Twist() << 0.003, -0.004, 0.008, 0.02, -0.015, 0.02).finished());
    prior_.covariance = Matrix6d::Zero();
    prior_.covariance->diagonal() << Eigen::Vector3d::Constant(36e-6), Eigen::Vector3d::Constant(1.2e-3);
    for (int k = 0; k <= 28; ++k) {
      const double time_s = k <= 16 ? 0.25 * k : 4 + (k - 16) / 12.0;
      const double left_rad = degToRad(turn_deg) * std::min(1.0, 5 - time_s);
      Pose T_frame_last = Pose::Identity();
      T_frame_last.linear() = expSO3({0, -left_rad, 0});
      T_frame_last = Eigen::Translation3d(0, 0, 0.75) * T_frame_last * Eigen::Translation3d(0, 0, -0.75);
      // Along the axis of the turn, and a third of it across, later or sooner.
      const auto lung = [](double t) { return std::pow(std::sin(kPi * t / 4), 4); };
      const Eigen::Vector3d breath = T_last_.linear().transpose() * breath_m *
                                     Eigen::Vector3d(0.3 * lung(time_s - lag_s), lung(time_s), 0.2 * lung(time_s));
      now_ = (tree_.points() + deformation_).colwise() + breath;
      const Pose T = T_frame_last * T_last_;
      Centerline2d shown = projectedCenterline(VesselTree(now_, tree_.parents()), camera_, T);
      for (Eigen::Index j = 0; j < shown.points_px.cols(); ++j) {
        const double du = random_.normal(), dv = random_.normal();
        shown.points_px.col(j) += Eigen::Vector2d(du, dv);
      }
      shown_ = makeCenterline(shown.points_px, shown.branch);
      PosePrior prior = prior_;
      prior.T_camera_model = T_frame_last * prior_.T_camera_model;
      const Pose start = k == 0 ? prior.T_camera_model : T_frame_last * seen_;
      alone_ = k == 0 ? registration->search(shown_, camera_, prior, {})
                      : registration->align(shown_, camera_, prior, start);
      seen_ = T_frame_last.inverse() * alone_.T_camera_model;
      frames_.push_back({alone_.evidence, T_frame_last, time_s});
    }
  }

  std::optional<DepthFromMotion> fit() const {
    return registration::depthFromMotion(frames_, XrayView{shown_, camera_}, prior_, tree_);
  }

  // Distances along the beam from where the tree is in the last frame, rms [m].
  double depthError_m(const RegistrationResult& found) const {
    const Eigen::Matrix3Xd there = found.T_camera_model * (tree_.points() + found.displacements_m).eval();
    return std::sqrt((there - T_last_ * now_).row(2).squaredNorm() / static_cast<double>(tree_.size()));
  }

  // The same across it.
  double acrossError_m(const RegistrationResult& found) const {
    const Eigen::Matrix3Xd there = found.T_camera_model * (tree_.points() + found.displacements_m).eval();
    return std::sqrt((there - T_last_ * now_).topRows<2>().squaredNorm() / static_cast<double>(tree_.size()));
  }

  // Share of the points whose depth lies within so many claimed standard deviations.
  double within(const RegistrationResult& found, double stds) const {
    int inside = 0;
    for (int i = 0; i < tree_.size(); ++i) {
      const Eigen::Vector3d p = tree_.points().col(i);
      const double off_m = (found.T_camera_model * (p + found.displacements_m.col(i)) - T_last_ * now_.col(i)).z();
      inside += std::abs(off_m) <= stds * std::sqrt(found.points->covarianceAt(p)(2, 2));
    }
    return static_cast<double>(inside) / tree_.size();
  }

  const RegistrationResult& alone() const { return alone_; }
  std::vector<MovingFrame>& frames() { return frames_; }

 private:
  Random random_;
  VesselTree tree_;
  XrayCamera camera_ = clinicalCamera();
  Pose T_last_, seen_;
  PosePrior prior_;
  Eigen::Matrix3Xd deformation_, now_;
  Centerline2d shown_;
  RegistrationResult alone_;
  std::vector<MovingFrame> frames_;
};

// One frame leaves the depth to the belief, which is 8 mm off; a turn of 6 deg tells it.
TEST(DepthFromMotion, FindsTheDepthOfADeformedTree) {
  double alone_m2 = 0, together_m2 = 0;
  constexpr int kTrees = 4;
  for (unsigned seed = 1; seed <= kTrees; ++seed) {
    const Turn turn(seed, 2e-3, 0);
    const auto found = turn.fit();
    ASSERT_TRUE(found);
    EXPECT_EQ(found->registration.status, RegistrationStatus::kConverged) << found->registration.reason;
    EXPECT_TRUE(found->registration.low_score_suffices) << "it ends near its start";
    EXPECT_NEAR(found->turn_rad, degToRad(6), 1e-3);
    EXPECT_GE(turn.within(found->registration, 3), 0.95) << seed;
    alone_m2 += std::pow(turn.depthError_m(turn.alone()), 2) / kTrees;
    together_m2 += std::pow(turn.depthError_m(found->registration), 2) / kTrees;
  }
  std::printf("depth, rms: one frame %.2f mm, a turn %.2f mm\n", 1e3 * std::sqrt(alone_m2),
              1e3 * std::sqrt(together_m2));
  EXPECT_LE(std::sqrt(together_m2), 1.5e-3);
  EXPECT_GE(std::sqrt(alone_m2), 3 * std::sqrt(together_m2));
}

// The breath moves the image by 60 px while a millimetre in depth moves it by half a pixel. What leads, frames to come
// would tell: less is known of it.
TEST(DepthFromMotion, FindsItWhileThePatientBreathes) {
  for (const auto& [lag_s, most_m] : {std::pair{0.3, 0.8e-3}, std::pair{-0.3, 2.5e-3}}) {
    double together_m2 = 0;
    constexpr int kTrees = 3;
    for (unsigned seed = 1; seed <= kTrees; ++seed) {
      const Turn turn(seed, 2e-3, 12e-3, 6, lag_s);
      const auto found = turn.fit();
      ASSERT_TRUE(found);
      EXPECT_GT(found->patient_motion_m, 2e-3);
      EXPECT_GE(turn.within(found->registration, 3), 0.95) << seed;
      together_m2 += std::pow(turn.depthError_m(found->registration), 2) / kTrees;
      // Found again in the last frame it is no further off across the beam; where nothing is gained it stays.
      EXPECT_LE(turn.acrossError_m(found->registration), 0.45e-3) << seed;
    }
    std::printf("depth while the patient breathes, %.1f s later across than along, rms: %.2f mm\n", lag_s,
                1e3 * std::sqrt(together_m2));
    EXPECT_LE(std::sqrt(together_m2), most_m);
  }
}

TEST(DepthFromMotion, SaysNothingWithoutATurnOrFrames) {
  EXPECT_FALSE(Turn(1, 2e-3, 0, 0.3).fit()) << "0.3 deg";
  Turn turn(1, 2e-3, 0);
  for (std::size_t f = 0; f + 3 < turn.frames().size(); ++f) turn.frames()[f].evidence = nullptr;
  EXPECT_FALSE(turn.fit()) << "three frames";
  turn.frames().clear();
  EXPECT_FALSE(turn.fit());
}

TEST(DepthFromMotion, IsTheSameForTheSameFrames) {
  const Turn turn(2, 2e-3, 12e-3);
  const auto a = turn.fit(), b = turn.fit();
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->registration.T_camera_model.matrix(), b->registration.T_camera_model.matrix());
  EXPECT_EQ(a->registration.displacements_m, b->registration.displacements_m);
}

}  // namespace
}  // namespace angio::test

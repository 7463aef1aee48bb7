// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/registration/sequence_tracker.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include "angio/test/errors.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/vessel/projection.hpp"

namespace angio::test {
namespace {

constexpr double kPeriod_s = 1 / 15.0;

double distance(const VesselTree& tree, const Pose& a, const Pose& b) {
  return ((a * tree.points()) - (b * tree.points())).colwise().norm().mean();
}

// A breath of 12 mm and 2 degrees over 4 s.
Pose breathing(const Pose& T, const VesselTree& tree, double time_s) {
  Twist xi;
  xi << Eigen::Vector3d(8, 8, 4) * 1e-3, degToRad(2) * Eigen::Vector3d(0.6, 0, 0.8);
  return test::perturbed(T, tree, std::sin(2 * kPi * time_s / 4) * xi);
}

RegistrationResult fit(const Pose& T, RegistrationStatus status, double score, double distance_px) {
  RegistrationResult result;
  result.T_camera_model = T;
  result.status = status;
  result.reason = status == RegistrationStatus::kConverged ? "" : "as the script says";
  result.agreement.model_explained = score;
  result.agreement.image_explained = 1;
  result.agreement.image_residual_px = distance_px;
  Vector6d deviation;
  deviation << Eigen::Vector3d::Constant(2e-4), Eigen::Vector3d::Constant(1e-3);
  result.covariance = Matrix6d(deviation.cwiseAbs2().asDiagonal());
  return result;
}

// Says what it is told, and remembers what it was asked.
class ScriptedRegistration final : public Registration {
 public:
  using Answer = std::function<RegistrationResult(const PosePrior&)>;
  Answer on_align, on_search;
  std::vector<PosePrior> aligned, searched;

  using Registration::align;
  using Registration::search;
  RegistrationResult align(const XrayViews&, const PosePrior& prior, const Pose&) override {
    aligned.push_back(prior);
    return on_align(prior);
  }
  RegistrationResult search(const XrayViews&, const PosePrior& prior, const StartSettings&,
                            const SearchProgress&) override {
    searched.push_back(prior);
    return on_search(prior);
  }
  const VesselTree& tree() const override { return tree_; }

 private:
  VesselTree tree_ = test::branchingTree(0, {0.02, -0.05, 0.1});
};

struct ScriptedSequence : testing::Test {
  ScriptedRegistration registration;
  SequenceTracker tracker{registration, {}, {}};
  test::Random random{1};
  Pose resting = test::viewOf(registration.tree(), random);
  PosePrior initial{test::perturbed(resting, registration.tree(), Twist::Constant(3e-3)), 1e-4 * Matrix6d::Identity()};
  Centerline2d image;
  XrayCamera camera = test::clinicalCamera();
  int frame = 0;

  Pose truth() const { return breathing(resting, registration.tree(), frame * kPeriod_s); }

  // 20 mm off in the picture, where another vessel runs alike.
  Pose elsewhere(const Pose& T) const { return Eigen::Translation3d(0.02, 0, 0) * T; }

  TrackedFrame step() {
    const TrackedFrame seen = tracker.step({XrayView{image, camera}}, frame * kPeriod_s, initial);
    ++frame;
    return seen;
  }

  double apart(const Pose& a, const Pose& b) const { return distance(registration.tree(), a, b); }

  // Frames as good as they come, until the motion is known.
  void followWell(int frames) {
    const auto good = [this](const PosePrior&) { return fit(truth(), RegistrationStatus::kConverged, 0.8, 1); };
    registration.on_align = registration.on_search = good;
    for (int i = 0; i < frames; ++i) ASSERT_TRUE(step().followed) << frame;
    registration.aligned.clear();
    registration.searched.clear();
  }
};

TEST_F(ScriptedSequence, SearchesAroundTheInitialPriorOnceAndThenTracksFromThePrediction) {
  registration.on_align = registration.on_search = [this](const PosePrior&) {
    return fit(truth(), RegistrationStatus::kConverged, 0.8, 1);
  };
  const TrackedFrame first = step();
  EXPECT_EQ(first.source, PoseSource::kSearched);
  EXPECT_TRUE(first.followed);
  EXPECT_FALSE(first.prediction);
  EXPECT_EQ(registration.searched.at(0).T_camera_model.matrix(), initial.T_camera_model.matrix());
  for (int i = 0; i < 60; ++i) {
    const TrackedFrame seen = step();
    EXPECT_EQ(seen.source, PoseSource::kTracked);
    EXPECT_TRUE(seen.followed);
    EXPECT_EQ(seen.doubt, "");
    const PosePrior& asked = registration.aligned.back();
    EXPECT_EQ(asked.T_camera_model.matrix(), seen.prediction->T_camera_model.matrix());
    EXPECT_LT((*asked.covariance - 9 * *seen.prediction->covariance).norm(), 1e-12) << "three times the deviation";
  }
  EXPECT_EQ(registration.searched.size(), 1u);
}

// A small curve in a large tree: never converged, its score a matter of chance.
TEST_F(ScriptedSequence, StaysInItsBasinWhenAPoorFitIsAllThereIs) {
  const auto poor = [this](const Pose& T, double gain) {
    const double score = gain * random.uniform(0.006, 0.014);
    const double distance_px = random.uniform(3, 4.2);
    return fit(T, RegistrationStatus::kAmbiguous, score, distance_px);
  };
  registration.on_align = [&](const PosePrior&) {
    if (frame % 10 == 7) return fit(truth(), RegistrationStatus::kDiverged, 0.002, 6.5);  // Worse than the others.
    return poor(truth(), 1);
  };
  registration.on_search = [&](const PosePrior&) {
    return frame == 0 ? poor(truth(), 1) : poor(elsewhere(truth()), 2);  // Twice the score, no nearer.
  };
  for (int i = 0; i < 150; ++i) {
    const Pose expected = truth();
    const TrackedFrame seen = step();
    EXPECT_LT(apart(seen.result.T_camera_model, expected), 1e-6) << i;
    EXPECT_EQ(seen.followed, i % 10 != 7) << i;
    if (i > 0) {
      EXPECT_LT(apart(seen.prediction->T_camera_model, expected), 3e-3) << i;
    }
  }
  // The first frame, 15 poor ones, and two a second against a wrong beginning: it does not search its way along.
  EXPECT_LE(registration.searched.size(), 1u + 15u + 20u);
}

TEST_F(ScriptedSequence, LeavesAWrongBeginningForAPoseThatFitsClearlyBetter) {
  registration.on_align = [this](const PosePrior& prior) {
    const bool right = apart(prior.T_camera_model, truth()) < 16e-3;
    return right ? fit(truth(), RegistrationStatus::kAmbiguous, 0.4, 2)
                 : fit(elsewhere(truth()), RegistrationStatus::kAmbiguous, 0.1, 6);
  };
  registration.on_search = registration.on_align;
  initial.T_camera_model = elsewhere(resting);
  EXPECT_NEAR(apart(step().result.T_camera_model, resting), 0.02, 1e-9);
  initial.T_camera_model = resting;  // From here on the initial prior would lead there.
  for (int i = 1; i < 25; ++i) {
    const Pose expected = truth();
    const TrackedFrame seen = step();
    EXPECT_TRUE(seen.followed);
    EXPECT_NEAR(apart(seen.result.T_camera_model, expected), i < 15 ? 0.02 : 0, 1e-9) << i;
  }
}

TEST_F(ScriptedSequence, CoastsOverPoorFramesAndIsThereWhenTheImageComesBack) {
  followWell(30);
  registration.on_align = registration.on_search = [this](const PosePrior&) {
    return fit(elsewhere(truth()), RegistrationStatus::kDiverged, 0.05, 9);
  };
  for (int i = 0; i < 3; ++i) {
    const Pose expected = truth();
    const TrackedFrame seen = step();
    EXPECT_FALSE(seen.followed);
    EXPECT_NE(seen.doubt, "");
    EXPECT_LT(apart(seen.prediction->T_camera_model, expected), 2e-3) << "a t^2 / 2 of 30 mm/s^2 in 0.2 s, and a lag";
  }
  followWell(1);
  EXPECT_EQ(registration.searched.size(), 0u) << "nothing was lost";
}

TEST_F(ScriptedSequence, WhenLostSearchesAroundTheInitialPriorAndTheLastPoseFollowed) {
  followWell(30);
  const Pose last = breathing(resting, registration.tree(), 29 * kPeriod_s);
  registration.on_align = registration.on_search = [this](const PosePrior&) {
    return fit(elsewhere(truth()), RegistrationStatus::kAmbiguous, 0.05, 9);
  };
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(tracker.tracking());
    EXPECT_FALSE(step().followed);
  }
  EXPECT_FALSE(tracker.tracking());
  registration.searched.clear();
  EXPECT_FALSE(step().followed) << "an ambiguous pose begins nothing where others have converged";
  ASSERT_EQ(registration.searched.size(), 2u);
  EXPECT_EQ(registration.searched[0].T_camera_model.matrix(), initial.T_camera_model.matrix());
  EXPECT_EQ(registration.searched[1].T_camera_model.matrix(), last.matrix());
  followWell(5);
  EXPECT_TRUE(tracker.tracking());
  tracker.reset();
  (void)step();
  EXPECT_EQ(registration.searched.size(), 1u) << "a new sequence knows nothing of the last";
}

TEST_F(ScriptedSequence, AfterALossTheLastPoseIsKeptUnlessTheInitialPriorLeadsToAClearlyBetterOne) {
  initial.T_camera_model = elsewhere(resting);
  double elsewhere_score = 0.009;
  registration.on_align = [this](const PosePrior&) { return fit(truth(), RegistrationStatus::kAmbiguous, 0.01, 3); };
  registration.on_search = [&](const PosePrior& prior) {
    const bool there = frame > 0 && apart(prior.T_camera_model, initial.T_camera_model) < 1e-3;
    return there
               ? fit(elsewhere(truth()), RegistrationStatus::kAmbiguous, elsewhere_score, elsewhere_score > 0.1 ? 1 : 3)
               : fit(truth(), RegistrationStatus::kAmbiguous, 0.01, 3);
  };
  const auto follow_and_lose = [this] {
    const auto on_align = registration.on_align, on_search = registration.on_search;
    ASSERT_TRUE(step().followed);
    registration.on_align = registration.on_search = [](const PosePrior&) { return RegistrationResult(); };
    for (int i = 0; i < 5; ++i) EXPECT_FALSE(step().followed);
    ASSERT_FALSE(tracker.tracking());
    registration.on_align = on_align;
    registration.on_search = on_search;
  };
  follow_and_lose();
  elsewhere_score = 0.013;
  Pose expected = truth();
  EXPECT_LT(apart(step().result.T_camera_model, expected), 1e-9) << "a little better is not clearly better";
  follow_and_lose();
  elsewhere_score = 0.2;
  expected = elsewhere(truth());
  EXPECT_LT(apart(step().result.T_camera_model, expected), 1e-9);
}

TEST_F(ScriptedSequence, WhereImageAndModelLieApartThePoseIsKnownNoBetterThanThat) {
  // 4 mm aside: 6 standard deviations of prediction and registration, or 2 when eight pixels (1.5 mm) lie between.
  const auto followed_with = [this](double distance_px) {
    tracker.reset();
    const auto steady = [=](const PosePrior&) {
      return fit(resting, RegistrationStatus::kConverged, 0.8, distance_px);
    };
    registration.on_align = registration.on_search = steady;
    for (int i = 0; i < 15; ++i) (void)step();
    registration.on_align = registration.on_search = [=](const PosePrior&) {
      return fit(Eigen::Translation3d(4e-3, 0, 0) * resting, RegistrationStatus::kConverged, 0.8, distance_px);
    };
    return step().followed;
  };
  EXPECT_FALSE(followed_with(0.5));
  EXPECT_TRUE(followed_with(8));
}

TEST_F(ScriptedSequence, AnEqualFitThatMotionDoesNotAllowIsNotFollowed) {
  followWell(30);
  const auto jumped = [this](const PosePrior&) {
    return fit(elsewhere(truth()), RegistrationStatus::kConverged, 0.85, 0.9);
  };
  registration.on_align = jumped;
  Pose now = truth();
  TrackedFrame seen = step();
  EXPECT_TRUE(seen.followed) << "the search found the place that motion allows";
  EXPECT_EQ(seen.source, PoseSource::kSearched);
  EXPECT_LT(apart(seen.result.T_camera_model, now), 1e-9);
  registration.on_search = jumped;
  now = truth();
  seen = step();
  EXPECT_FALSE(seen.followed);
  ASSERT_TRUE(seen.innovation);
  EXPECT_FALSE(seen.innovation->insideGate());
  EXPECT_LT(apart(seen.prediction->T_camera_model, now), 2e-3);
}

TEST_F(ScriptedSequence, FollowsAPatientWhoMovedWhenOnlyTheNewPlaceFits) {
  followWell(30);
  registration.on_align = [this](const PosePrior& prior) {
    return apart(prior.T_camera_model, elsewhere(truth())) < 5e-3
               ? fit(elsewhere(truth()), RegistrationStatus::kConverged, 0.78, 1.1)
               : fit(truth(), RegistrationStatus::kAmbiguous, 0.2, 6);
  };
  registration.on_search = [this](const PosePrior&) {
    return fit(elsewhere(truth()), RegistrationStatus::kConverged, 0.78, 1.1);
  };
  const TrackedFrame seen = step();
  EXPECT_TRUE(seen.followed);
  EXPECT_EQ(seen.source, PoseSource::kSearched);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(step().source, PoseSource::kTracked) << "tracked from its new place";
}

TEST_F(ScriptedSequence, RegistrationsWithoutAPoseAreMissesAndNothingThrows) {
  const auto nothing = [](const PosePrior&) { return RegistrationResult(); };
  registration.on_align = registration.on_search = nothing;
  EXPECT_FALSE(step().followed);
  EXPECT_FALSE(tracker.tracking());
  followWell(10);
  registration.on_align = registration.on_search = nothing;
  const TrackedFrame seen = step();
  EXPECT_FALSE(seen.followed);
  EXPECT_FALSE(seen.innovation);
  SequenceTrackerSettings never;
  never.motion.acceleration_mean_s = 0;
  EXPECT_THAT(test::refusalOf([&] { SequenceTracker(registration, never, {}); }),
              testing::HasSubstr("acceleration_mean_s"));
}

TEST(SequenceTracker, FollowsABreathingTreeWithoutEverLosingIt) {
  const VesselTree tree = test::branchingTree(4, {0.02, -0.05, 0.1});
  test::Random random(5);
  const Pose resting = test::viewOf(tree, random);
  const XrayCamera camera = test::clinicalCamera();
  const auto registration = makeRegistration(IterativePnpSettings(), tree);
  SequenceTracker tracker(*registration, {}, {});
  Vector6d deviation;
  deviation << Eigen::Vector3d::Constant(5e-3), Eigen::Vector3d::Constant(degToRad(2));
  const Twist off = (Twist() << 2e-3, -2e-3, 2e-3, 0.01, 0.01, -0.01).finished();
  const PosePrior initial{test::perturbed(resting, tree, off), Matrix6d(deviation.cwiseAbs2().asDiagonal())};
  for (int frame = 0; frame < 120; ++frame) {
    const Pose truth = breathing(resting, tree, frame * kPeriod_s);
    const Centerline2d clean = projectedCenterline(tree, camera, truth);
    Eigen::Matrix2Xd points = clean.points_px;
    for (int i = 0; i < points.cols(); ++i) {
      const double x = random.normal(), y = random.normal();
      points.col(i) += 0.5 * Eigen::Vector2d(x, y);
    }
    const Centerline2d image = makeCenterline(points, clean.branch);
    const TrackedFrame seen = tracker.step({XrayView{image, camera}}, frame * kPeriod_s, initial);
    EXPECT_TRUE(seen.followed) << frame << ": " << seen.doubt;
    EXPECT_EQ(seen.source, frame == 0 ? PoseSource::kSearched : PoseSource::kTracked) << frame << ": " << seen.doubt;
    EXPECT_EQ(seen.result.status, RegistrationStatus::kConverged) << frame << ": " << seen.result.reason;
    // Depth is what half a pixel leaves open: 0.1 mm; four of these.
    EXPECT_LT(distance(tree, seen.result.T_camera_model, truth), 0.4e-3) << frame;
    if (frame >= 3) {
      // A frame moves the tree by up to 1.3 mm; the lag that 30 mm/s^2 leave is 0.4 mm, and the noise 0.1 mm.
      EXPECT_LT(distance(tree, seen.prediction->T_camera_model, truth), 0.8e-3) << frame;
    }
  }
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "angio/geometry/se3.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

constexpr double kDt = 0.066667, kLatency_s = 0.08, kValid_s = 0.2;
const CArmLimits kLimits = CArmLimits::typical(0.303);
const CArmEnvelope& kEnvelope = kLimits.envelope;

CArmJoints randomWithin(test::Random& random, const CArmJoints& bound) {
  return CArmJoints::NullaryExpr([&](Eigen::Index i) { return random.uniform(-bound[i], bound[i]); });
}

// A limiter and the arm that its commands reach after the latency, watched millisecond by millisecond.
class Lab {
 public:
  explicit Lab(const CArmJoints& start) : arm_(kLimits, start, 0) {}

  CArmMotionLimiter limiter{kLimits, kValid_s};
  double min_clearance = std::numeric_limits<double>::infinity();  // To a face of the envelope, [rad] or [m].
  double fastest = 0, hardest = 0;                                 // Shares of the arm's limits.
  double jerkiest = 0;                                             // Share of the command's.
  double furthest = 0;                                             // Share of the range.
  double modelled = 0;                                             // Between the arm as it is and as it was predicted.

  CArmState state() const { return arm_.state(); }

  /// One frame and the time until the next: the joints now, and the command for `wanted`, which arrives after the
  /// latency unless it is lost.
  CArmJoints frame(const CArmJoints& wanted, double period_s, bool holds = false, bool lost = false) {
    const CArmJoints joints = arm_.state().joints;
    const CArmJoints command = holds ? limiter.rest(since_s_) : limiter.limit(wanted, joints, kLatency_s, since_s_);
    const CArmJoints a = (command - last_) / since_s_;
    if (!holds && !held_) {
      jerkiest = std::max(jerkiest, (a - last_a_).cwiseAbs().cwiseQuotient(kLimits.jerk * since_s_).maxCoeff());
    }
    since_s_ = period_s;
    held_ = holds;
    last_a_ = a;
    last_ = command;
    const std::int64_t arrives_us = now_us_ + std::llround(kLatency_s * 1e6);
    CArmCommand message;
    message.time_us = now_us_;
    message.sequence = ++sequence_;
    message.time_us = now_us_;
    message.valid_for_us = std::llround(kValid_s * 1e6);
    message.velocity = command;
    if (!lost) in_transit_.push_back({arrives_us, message, limiter.predicted(joints, kLatency_s)});
    run(period_s);
    return command;
  }

  /// Watches the arm for a time.
  void run(double duration_s) {
    for (const std::int64_t end_us = now_us_ + std::llround(duration_s * 1e6); now_us_ < end_us;) {
      const CArmState before = arm_.state();
      std::int64_t next_us = std::min(now_us_ + 1000, end_us);
      if (!in_transit_.empty()) next_us = std::min(next_us, in_transit_.front().arrives_us);
      now_us_ = next_us;
      arm_.advance(now_us_);
      if (!in_transit_.empty() && in_transit_.front().arrives_us == now_us_) {
        const CArmJoints missed = arm_.state().joints - in_transit_.front().predicted;
        modelled = std::max(modelled, missed.cwiseAbs().maxCoeff());
        arm_.obey(in_transit_.front().command, now_us_);
        in_transit_.pop_front();
      }
      const CArmState after = arm_.state();
      const double dt_s = 1e-6 * static_cast<double>(after.time_us - before.time_us);
      if (dt_s <= 0) continue;
      for (const CArmEnvelope::Face& face : kEnvelope.faces) {
        min_clearance = std::min(min_clearance, face.room(after.joints) / face.normal.norm());
      }
      fastest = std::max(fastest, after.velocity.cwiseAbs().cwiseQuotient(kLimits.velocity).maxCoeff());
      const CArmJoints change = after.velocity - before.velocity;
      hardest = std::max(hardest, change.cwiseAbs().cwiseQuotient(kLimits.acceleration * dt_s).maxCoeff());
      furthest = std::max(furthest, after.joints.cwiseAbs().cwiseQuotient(kLimits.upper).maxCoeff());
    }
  }

 private:
  struct InTransit {
    std::int64_t arrives_us;
    CArmCommand command;
    CArmJoints predicted;
  };
  SimulatedCArm arm_;
  std::deque<InTransit> in_transit_;
  std::int64_t now_us_ = 0, sequence_ = 0;
  CArmJoints last_ = CArmJoints::Zero(), last_a_ = CArmJoints::Zero();
  double since_s_ = kDt;
  bool held_ = false;
};

void expectWithinLimits(const Lab& lab, double min_clearance) {
  EXPECT_GE(lab.min_clearance, min_clearance);
  EXPECT_LE(lab.fastest, 1 + 1e-9);
  EXPECT_LE(lab.hardest, 1 + 1e-6);  // Of differences of a millisecond.
  EXPECT_LE(lab.furthest, 1 + 1e-9);
}

TEST(CArmMotionLimiter, KeepsEveryLimitWhateverIsWanted) {
  test::Random random(1);
  Lab lab(CArmJoints::Zero());
  CArmJoints wanted = CArmJoints::Zero();
  for (int i = 0; i < 15000; ++i) {
    if (i % 60 == 0 || random.uniform(0, 1) < 0.02) wanted = randomWithin(random, 3 * kLimits.velocity);
    lab.frame(wanted, kDt);
  }
  expectWithinLimits(lab, -1e-6);  // Commands arrive on whole microseconds.
  EXPECT_LE(lab.jerkiest, 1 + 1e-6);
  EXPECT_LT(lab.modelled, 1e-7) << "the arm is not where the limiter thinks";
  EXPECT_GT(lab.furthest, 0.999) << "the range's end was never reached, so nothing was tested";
  EXPECT_LT(lab.min_clearance, 0.01) << "nor the envelope";
}

TEST(CArmMotionLimiter, KeepsEveryLimitWithFramesMissingHoldsAndSilence) {
  test::Random random(2);
  Lab lab(CArmJoints::Zero());
  CArmJoints wanted = CArmJoints::Zero();
  for (int i = 0; i < 15000; ++i) {
    if (i % 60 == 0) wanted = randomWithin(random, 3 * kLimits.velocity);
    const double event = random.uniform(0, 1);
    const double period_s = event < 0.1 ? kDt * std::ceil(random.uniform(1, 6)) : kDt;
    lab.frame(wanted, period_s, event > 0.95);
  }
  expectWithinLimits(lab, -1e-6);  // Commands arrive on whole microseconds.
  EXPECT_GT(lab.furthest, 0.999);
}

TEST(CArmMotionLimiter, LostCommandsCostLittleRoom) {
  test::Random random(3);
  Lab lab(CArmJoints::Zero());
  CArmJoints wanted = CArmJoints::Zero();
  for (int i = 0; i < 15000; ++i) {
    if (i % 60 == 0) wanted = randomWithin(random, 3 * kLimits.velocity);
    lab.frame(wanted, kDt, false, random.uniform(0, 1) < 0.2);
  }
  // What is lost was counted on: a frame's change of speed over the frames until the encoders tell, a dt^2 each.
  expectWithinLimits(lab, -degToRad(1));
}

TEST(CArmMotionLimiter, ABlockedJointLetsTheOthersGoOn) {
  CArmJoints start = CArmJoints::Zero();
  start[0] = kLimits.upper[0] - degToRad(3);
  start[2] = -0.2;  // The table's side out of the way.
  Lab lab(start);
  const CArmJoints wanted = 0.8 * kLimits.velocity;
  CArmJoints command;
  for (int i = 0; i < 30; ++i) command = lab.frame(wanted, kDt);
  EXPECT_NEAR(lab.state().joints[0], kLimits.upper[0], degToRad(0.05));
  // Secondary is held by the corner of the envelope; the table's x by its side; the others reach their speed.
  EXPECT_NEAR(command[3], wanted[3], 1e-9);
  EXPECT_NEAR(command[4], wanted[4], 1e-9);
  EXPECT_GE(lab.min_clearance, 0);
}

TEST(CArmMotionLimiter, SlidesAlongAFaceTowardsWhatIsWanted) {
  CArmJoints start = CArmJoints::Zero();
  start.head<2>() << degToRad(60), degToRad(45);
  Lab lab(start);
  // Straight at the corner |p| + 2 |s| = 180 deg, and along it towards less secondary.
  CArmJoints wanted = CArmJoints::Zero();
  wanted.head<2>() << degToRad(20), degToRad(5);
  double max_secondary = 0;
  for (int i = 0; i < 150; ++i) {
    lab.frame(wanted, kDt);
    max_secondary = std::max(max_secondary, lab.state().joints[1]);
  }
  const CArmJoints end = lab.state().joints;
  EXPECT_GT(end[0], start[0] + degToRad(20)) << "stuck at the face";
  EXPECT_LT(end[1], max_secondary - degToRad(2)) << "did not give way";
  EXPECT_GE(lab.min_clearance, 0);
}

TEST(CArmMotionLimiter, ComesToAWishWithoutShootingOver) {
  Lab lab(CArmJoints::Zero());
  const CArmJoints wanted = 0.5 * kLimits.velocity;
  double highest = 0;
  CArmJoints command;
  for (int i = 0; i < 25; ++i) {
    command = lab.frame(wanted, kDt);
    highest = std::max(highest, command.cwiseQuotient(wanted).maxCoeff());
  }
  EXPECT_LE(highest, 1 + 1e-9);
  EXPECT_LT((command - wanted).norm(), 1e-9);
}

TEST(CArmMotionLimiter, FromOutsideTheEnvelopeThereIsOnlyTheWayBack) {
  CArmJoints outside = CArmJoints::Zero();
  outside.head<2>() << degToRad(110), degToRad(40);
  ASSERT_TRUE(kEnvelope.violated(outside));
  Lab lab(outside);
  for (int i = 0; i < 30; ++i) lab.frame(outside, kDt);
  const CArmEnvelope::Face& face = *kEnvelope.violated(outside);
  EXPECT_GT(face.room(lab.state().joints), face.room(outside) - 1e-6);
  CArmJoints back = CArmJoints::Zero();
  back.head<2>() = -outside.head<2>();
  for (int i = 0; i < 45; ++i) lab.frame(back, kDt);
  EXPECT_FALSE(kEnvelope.violated(lab.state().joints));
}

// A proposal that is not sent has not moved the arm: the next one begins as if the arm had been told to stand still.
TEST(CArmMotionLimiter, CountsFromWhatWasSent) {
  const CArmJoints wish = kLimits.velocity, at = CArmJoints::Zero();
  CArmMotionLimiter obeyed(kLimits, kValid_s), withheld(kLimits, kValid_s), resting(kLimits, kValid_s);
  CArmJoints last = CArmJoints::Zero();
  for (int k = 0; k < 5; ++k) {
    const CArmJoints v = obeyed.propose(wish, at, kLatency_s, kDt);
    obeyed.commit(v);
    EXPECT_GT(v[0], last[0]);
    last = v;
    withheld.propose(wish, at, kLatency_s, kDt);
    withheld.commit(CArmJoints::Zero());
    resting.rest(kDt);
  }
  EXPECT_EQ(withheld.limit(wish, at, kLatency_s, kDt), resting.limit(wish, at, kLatency_s, kDt));
  EXPECT_LT(withheld.limit(wish, at, kLatency_s, kDt)[0], obeyed.limit(wish, at, kLatency_s, kDt)[0]);
}

TEST(CArmMotionLimiter, WhatIsNotANumberStandsStill) {
  const CArmJoints ok = 0.1 * kLimits.velocity;
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    CArmMotionLimiter limiter(kLimits, kValid_s);
    CArmJoints bad = ok;
    bad[3] = wrong;
    EXPECT_TRUE(limiter.limit(bad, ok, kLatency_s, kDt).isZero(0));
    EXPECT_TRUE(limiter.limit(ok, bad, kLatency_s, kDt).isZero(0));
    EXPECT_TRUE(limiter.limit(ok, ok, wrong, kDt).isZero(0));
    EXPECT_TRUE(limiter.limit(ok, ok, kLatency_s, wrong).isZero(0));
    EXPECT_TRUE(limiter.limit(ok, ok, kLatency_s, -kDt).isZero(0));
    EXPECT_TRUE(limiter.limit(ok, ok, -kLatency_s, kDt).isZero(0));
    // And the next sound wish is answered as if nothing had been.
    EXPECT_EQ(limiter.limit(ok, ok, kLatency_s, kDt),
              CArmMotionLimiter(kLimits, kValid_s).limit(ok, ok, kLatency_s, kDt));
  }
}

TEST(CArmMotionLimiter, RefusesLimitsThatAreNone) {
  CArmLimits limits = kLimits;
  limits.jerk[2] = 0;
  EXPECT_EQ(test::refusalOf([&] { CArmMotionLimiter(limits, kValid_s); }),
            "c-arm limits: jerk[2] = 0: must be a positive number");
  limits = kLimits;
  limits.envelope.faces.push_back({"wall", CArmJoints::Zero(), 1});
  EXPECT_EQ(test::refusalOf([&] { CArmMotionLimiter(limits, kValid_s); }),
            "c-arm envelope: wall: length of the normal = 0: must be a positive number");
}

}  // namespace
}  // namespace angio::test

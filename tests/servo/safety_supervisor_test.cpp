// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/safety_supervisor.hpp"
#include "angio/test/namespace.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "angio/test/errors.hpp"
#include "frame_period.hpp"

namespace angio::test {
namespace {

// An operator who wants to servo, a machine that does what it is told, and frames that can be trusted.
class Safety : public testing::Test {
 protected:
  void ask(ServoRequestKind kind) {
    ServoRequest r;
    r.sequence = ++requests_;
    r.time_us = requests_;
    r.transitions = safety_.states().transitions();
    r.status_time_us = frame_us_;
    r.request = kind;
    safety_.request(r, now_us_);
  }
  // One frame with its joints; returns what begin() says of it.
  std::string frame(const Pose& seen = Pose::Identity()) {
    now_us_ += kPeriod_us;
    ++k_;
    arm_.time_us = now_us_;
    arm_.sequence = k_;
    safety_.observe(arm_, now_us_);
    frame_us_ = now_us_;
    XrayFrame f{now_us_, k_, cv::Mat(4, 4, CV_8UC1), XrayCamera::centered(4, 4, 1e-3, 1)};
    f.image.setTo(static_cast<double>(k_ % 251));
    const auto wrong = safety_.begin(f, now_us_);
    if (!wrong) safety_.accept(seen, Eigen::Vector3d::UnitY(), now_us_);
    safety_.commanded(permits(wanted_) ? command(wanted_) : atRest(command(wanted_)));
    return wrong.value_or("");
  }
  void start() {
    ask(ServoRequestKind::kArm);
    ask(ServoRequestKind::kStart);
    for (int i = 0; i < SafetySettings().states.frames_to_start; ++i) EXPECT_EQ(frame(), "");
    EXPECT_TRUE(safety_.moves()) << safety_.states().reason();
  }
  ServoState state() const { return safety_.states().state(); }

  const Eigen::Vector3d target_{0, 0, 0.1};
  static SafetySupervisor<MotionMonitor> safetyOf(const SafetySettings& settings, const Eigen::Vector3d& target) {
    const CArmLimits limits = CArmLimits::typical();
    return {settings, limits, target, MotionMonitor(settings.motion, limits)};
  }
  CArmCommand command(const CArmJoints& velocity) const { return {now_us_, k_, k_, 200'000, velocity}; }
  bool permits(const CArmJoints& velocity) const { return safety_.permits(command(velocity)); }

  SafetySupervisor<MotionMonitor> safety_ = safetyOf({}, target_);
  CArmJoints wanted_ = CArmJoints::Zero();
  CArmState arm_;
  std::int64_t now_us_ = 0, frame_us_ = 0, k_ = 0, requests_ = 0;
};

TEST_F(Safety, PermitsMotionInServoOnlyAndNeverANan) {
  const CArmJoints wish = CArmJoints::Constant(0.01);
  EXPECT_FALSE(permits(wish));
  start();
  EXPECT_TRUE(permits(wish));
  CArmJoints nan = wish;
  nan[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(permits(nan));
  safety_.reject(FrameSupervisor::RejectionKind::kUnseen, "no contrast agent", now_us_);
  EXPECT_FALSE(permits(wish));
}

TEST_F(Safety, TheGuardWantsFramesThatAgree) {
  ask(ServoRequestKind::kArm);
  ask(ServoRequestKind::kStart);
  for (int i = 0; i < 20; ++i) {  // Right one by one, but the patient would have to leap.
    frame(Pose(Eigen::Translation3d(0, 0, i % 2 == 0 ? 0.0 : 0.01)));
    EXPECT_FALSE(safety_.moves());
  }
  for (int i = 0; i < 4; ++i) frame();
  EXPECT_TRUE(safety_.moves());
}

// The beam runs along y: one view sees poorly how far away the patient is.
TEST_F(Safety, TheGuardAllowsMoreInDepth) {
  ask(ServoRequestKind::kArm);
  ask(ServoRequestKind::kStart);
  const auto leap = [](double mm, int i) { return Pose(Eigen::Translation3d(0, i % 2 == 0 ? 0.0 : 1e-3 * mm, 0)); };
  const double max_mm = SafetySettings().max_start_spread_depth_mm;
  for (int i = 0; i < 20; ++i) {
    frame(leap(max_mm + 0.1, i));
    EXPECT_FALSE(safety_.moves());
  }
  for (int i = 0; i < SafetySettings().states.frames_to_start + 1; ++i) frame(leap(max_mm - 0.1, i));
  EXPECT_TRUE(safety_.moves()) << safety_.states().reason();
}

TEST_F(Safety, AJointThatMovesByItselfIsAFaultUntilResetAndArmed) {
  start();
  for (int i = 0; i < 10; ++i) {
    arm_.joints[0] += degToRad(0.5);
    frame();
  }
  EXPECT_EQ(state(), ServoState::kFault);
  EXPECT_EQ(safety_.states().log().back().cause, ServoCause::kMotionDisagrees);
  ask(ServoRequestKind::kReset);
  EXPECT_EQ(state(), ServoState::kIdle);
  start();
}

TEST_F(Safety, AnIdleMachineMayBeMovedByHand) {
  for (int i = 0; i < 30; ++i) {
    arm_.joints[0] += degToRad(1);
    frame();
  }
  EXPECT_EQ(state(), ServoState::kIdle);
  start();
}

TEST_F(Safety, EachWrongInputEndsInRest) {
  struct Case {
    const char* what;
    ServoState ends;
    std::function<void()> happen;
  };
  const Case cases[] = {
      {"joints not finite", ServoState::kFault,
       [&] { arm_.joints[1] = std::numeric_limits<double>::quiet_NaN(), frame(), arm_.joints[1] = 0; }},
      {"joint out of range", ServoState::kFault, [&] { arm_.joints[2] = 0.31, frame(), arm_.joints[2] = 0; }},
      {"degrees", ServoState::kFault, [&] { arm_.joints[0] = 40, frame(), arm_.joints[0] = 0; }},
      {"no frames", ServoState::kFault, [&] { safety_.wait(now_us_ += 2'500'000); }},
      {"late frames", ServoState::kHold,
       [&] {
         safety_.wait(now_us_ + 300'000);
         now_us_ += 300'000;
       }},
      {"X-ray's clock", ServoState::kFault,
       [&] {
         frame_us_ = now_us_ - 5'000'000;
         XrayFrame f{frame_us_, ++k_, cv::Mat::ones(4, 4, CV_8UC1), XrayCamera::centered(4, 4, 1e-3, 1)};
         EXPECT_TRUE(safety_.begin(f, now_us_ += kPeriod_us));
       }},
      {"emergency stop", ServoState::kEmergencyStop, [&] { ask(ServoRequestKind::kEmergencyStop); }},
      {"stop", ServoState::kIdle, [&] { ask(ServoRequestKind::kStop); }},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    start();
    c.happen();
    EXPECT_EQ(state(), c.ends) << safety_.states().reason();
    EXPECT_FALSE(permits(CArmJoints::Constant(0.01)));
    ServoStatus status;
    safety_.describe(status);
    EXPECT_EQ(status.state, c.ends);
    EXPECT_NE(status.reason, "");
    EXPECT_EQ(status.transitions, safety_.states().transitions());
    ask(ServoRequestKind::kReset);
    ask(ServoRequestKind::kStop);
    EXPECT_EQ(state(), ServoState::kIdle);
  }
}

TEST_F(Safety, TheSettingsAreChecked) {
  SafetySettings settings;
  settings.motion.max_following_error_deg = -1;
  EXPECT_NE(test::refusalOf([&] { safetyOf(settings, target_); }).find("max_following_error_deg"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <deque>

#include "angio/robot/carm_motion_limiter.hpp"
#include "angio/robot/motion_time.hpp"
#include "angio/servo/tasks.hpp"
#include "angio/simulation/simulated_carm.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"
#include "frame_period.hpp"

namespace angio::test {
namespace {

constexpr std::int64_t kLatency_us = 80'000;

// The task, the limiter and an arm whose commands come late; what is seen is the truth.
class Lab {
 public:
  Lab(const ViewTaskSettings& settings, const ServoLawSettings& law = JointSpaceSettings{})
      : task(makeTask(settings, {carm, limits, tree, tree.centroid(), Eigen::Matrix3d::Identity(), law})) {
    Twist askew;
    askew << 0.01, -0.02, 0.005, 0.03, -0.05, 0.04;
    T_patient_model = expSE3(askew);
    arm = std::make_unique<SimulatedCArm>(limits, start, 0);
  }

  TaskAnswer frame() {
    const CArmState state = arm->state();
    const Pose seen = carm.T_camera_patient(state.joints) * T_patient_model;
    TaskInput input{now_us, carm.camera(), seen, covariance, seen, state};
    input.last_velocity = last;
    input.period_s = 1e-6 * kPeriod_us;
    input.latency_s = 1e-6 * kLatency_us;
    const TaskAnswer answer = task->answer(input);
    last = answer.velocity ? limiter.limit(*answer.velocity, state.joints, input.latency_s, input.period_s)
                           : limiter.rest(input.period_s);
    CArmCommand command;
    command.sequence = ++sequence;
    command.time_us = now_us;
    command.valid_for_us = 200'000;
    command.velocity = last;
    in_transit.push_back({now_us + kLatency_us, command});
    for (const std::int64_t end_us = now_us + kPeriod_us; now_us < end_us;) {
      const bool arrives = !in_transit.empty() && in_transit.front().first <= end_us;
      now_us = arrives ? in_transit.front().first : end_us;
      arm->advance(now_us);
      if (!arrives) continue;
      arm->obey(in_transit.front().second, now_us);
      in_transit.pop_front();
    }
    return answer;
  }

  // Until it says that it is there, at most 20 s; when it came within the bounds to stay, by the truth.
  std::optional<double> settled_s() {
    const Pose desired = *task->desired_T_camera_model();
    const Eigen::Vector3d target = desired.inverse() * Eigen::Vector3d(0, 0, carm.source_isocenter_distance_m);
    std::optional<double> since_s;
    for (int i = 0; i < 300; ++i) {
      const bool reached = frame().reached;
      error = viewError(carm.T_camera_patient(arm->state().joints) * T_patient_model, desired, target);
      const bool inside = radToDeg(error.direction_rad) <= 0.1 && 1e3 * error.target_m <= 0.5;
      if (!inside) since_s.reset();
      if (inside && !since_s) since_s = 1e-6 * static_cast<double>(now_us);
      if (reached) return since_s;
    }
    return std::nullopt;
  }

  CArmGeometry carm;
  CArmLimits limits = CArmLimits::typical(0.303);
  VesselTree tree = test::branchingTree(6);
  CArmJoints start = (CArmJoints() << degToRad(-20), degToRad(10), 0.03, -0.02, 0.05).finished();
  Matrix6d covariance = Matrix6d::Identity() * 1e-9;
  Pose T_patient_model;
  CArmMotionLimiter limiter{limits, 0.2};
  std::unique_ptr<Task> task;
  std::unique_ptr<SimulatedCArm> arm;
  CArmJoints last = CArmJoints::Zero();
  std::deque<std::pair<std::int64_t, CArmCommand>> in_transit;
  std::int64_t now_us = 0, sequence = 0;
  ViewError error;
};

TEST(ViewTask, ReachesEachKindOfGoalByEachLaw) {
  for (const ServoLawSettings& law : {ServoLawSettings(JointSpaceSettings{}), ServoLawSettings(PositionBasedSettings{}),
                                      ServoLawSettings(ImageBasedSettings{}), ServoLawSettings(HybridSettings{})}) {
    for (const ViewGoal goal : {ViewGoal::kAngles, ViewGoal::kBestView, ViewGoal::kPose}) {
      ViewTaskSettings settings;
      settings.goal = goal;
      settings.branch = 2;
      if (law.index() > 0) settings.max_table_excursion_mm = settings.max_target_excursion_mm = 0;
      settings.best_view.step_deg = 5;
      settings.T_camera_model = desiredPose({{degToRad(-45), degToRad(20)}, {0.01, 0, 0}, Eigen::Matrix3d::Identity()},
                                            CArmGeometry().source_isocenter_distance_m);
      // As another arm has seen it, one that had turned its detector.
      settings.T_camera_model = Pose(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())) * settings.T_camera_model;
      Lab lab(settings, law);
      EXPECT_TRUE(lab.settled_s()) << law.index() << " " << static_cast<int>(goal);
    }
  }
}

TEST(ViewTask, ComesInNotMuchSlowerThanAnyMachineCould) {
  test::Random random(1);
  double worst = 0;
  for (int i = 0; i < 10; ++i) {
    ViewTaskSettings settings;
    settings.primary_deg = random.uniform(-60, 60);
    settings.secondary_deg = random.uniform(-30, 30);
    Lab lab(settings);
    const auto settled_s = lab.settled_s();
    ASSERT_TRUE(settled_s) << i;
    const double min_s = minTime_s(lab.start, lab.arm->state().joints, lab.limits);
    worst = std::max(worst, *settled_s - min_s);
  }
  // The latency, and the last degree that the law takes exponentially: ln(1 / 0.1) / 3.
  EXPECT_LT(worst, 2.0);
}

// The table's largest distance from the box of start and goal, and the target's beyond its distance at the start [mm].
struct Excursions {
  double table_mm = 0, target_mm = 0;
  std::optional<std::string> hold_reason;
};

Excursions excursionsOf(Lab& lab, int frames = 150) {
  const Pose desired = *lab.task->desired_T_camera_model();
  const Eigen::Vector3d on_beam = desired.inverse() * Eigen::Vector3d(0, 0, lab.carm.source_isocenter_distance_m);
  const Eigen::Vector3d beam = lab.T_patient_model.linear() * desired.linear().row(2).transpose();
  const CArmJoints goal = *lab.carm.reachable(viewAnglesOf(beam), lab.T_patient_model * on_beam, lab.limits, lab.start);
  const auto distance_mm = [&](const CArmJoints& q) {
    return 1e3 * viewError(lab.carm.T_camera_patient(q) * lab.T_patient_model, desired, on_beam).target_m;
  };
  Eigen::AlignedBox3d box;
  box.extend(Eigen::Vector3d(lab.start.tail<3>()));
  box.extend(Eigen::Vector3d(goal.tail<3>()));
  Excursions most;
  for (int i = 0; i < frames; ++i) {
    const TaskAnswer answer = lab.frame();
    if (answer.hold_reason && !most.hold_reason) most.hold_reason = answer.hold_reason;
    const CArmJoints q = lab.arm->state().joints;
    most.table_mm = std::max(most.table_mm, 1e3 * box.exteriorDistance(Eigen::Vector3d(q.tail<3>())));
    most.target_mm = std::max(most.target_mm, distance_mm(q) - distance_mm(lab.start));
  }
  return most;
}

TEST(ViewTask, JointSpaceKeepsTheTrajectoryBetweenStartAndGoal) {
  test::Random random(3);
  for (int i = 0; i < 10; ++i) {
    ViewTaskSettings settings;
    settings.primary_deg = random.uniform(-60, 60);
    settings.secondary_deg = random.uniform(-30, 30);
    Lab lab(settings);
    const Excursions most = excursionsOf(lab);
    EXPECT_FALSE(most.hold_reason) << *most.hold_reason;
    EXPECT_LT(most.table_mm, 0.5) << i;
    EXPECT_LT(most.target_mm, 0.5) << i;
  }
}

ViewTaskSettings farView() {
  ViewTaskSettings settings;
  settings.primary_deg = 30;
  settings.secondary_deg = 15;
  settings.max_table_excursion_mm = settings.max_target_excursion_mm = 0;
  return settings;
}

// From where the target is in its place already, so that no motion of it is allowed.
struct AngledLab : Lab {
  explicit AngledLab(const ViewTaskSettings& settings) : Lab(settings, PositionBasedSettings{}) {
    start = carm.jointsFor({}, T_patient_model * tree.centroid());
    arm = std::make_unique<SimulatedCArm>(limits, start, 0);
  }
};

// The camera's straight path takes the table far out: each bound by itself stops it in time, and says so.
TEST(ViewTask, HoldsBeforeATrajectoryLeavesItsBounds) {
  AngledLab free(farView());
  const Excursions most = excursionsOf(free);
  EXPECT_FALSE(most.hold_reason);
  ASSERT_GT(most.table_mm, 30);
  ViewTaskSettings settings = farView();
  settings.max_table_excursion_mm = most.table_mm / 2;
  AngledLab lab(settings);
  const Excursions bounded = excursionsOf(lab);
  EXPECT_NE(bounded.hold_reason.value_or("").find("view.max_table_excursion_mm"), std::string::npos);
  // What one frame adds before the next is looked at.
  EXPECT_LT(bounded.table_mm, settings.max_table_excursion_mm + 10);
  EXPECT_TRUE(lab.last.isZero(0)) << "still broken";
  // Moved back by hand, it goes on.
  lab.arm = std::make_unique<SimulatedCArm>(lab.limits, lab.start, lab.now_us);
  EXPECT_TRUE(lab.frame().velocity);
}

TEST(ViewTask, HoldsBeforeTheTargetGoesTooFar) {
  AngledLab free(farView());
  const Excursions most = excursionsOf(free);
  ASSERT_GT(most.target_mm, 30);
  ViewTaskSettings settings = farView();
  settings.max_target_excursion_mm = most.target_mm / 2;
  AngledLab lab(settings);
  const Excursions bounded = excursionsOf(lab);
  EXPECT_NE(bounded.hold_reason.value_or("").find("view.max_target_excursion_mm"), std::string::npos);
  EXPECT_LT(bounded.target_mm, settings.max_target_excursion_mm + 10);
  EXPECT_TRUE(lab.last.isZero(0));
}

// A machine that is not allowed to move starts its trajectory where it stands when it is; one that is held for a moment
// goes on with the old one.
TEST(ViewTask, ATrajectoryBeginsWhereTheMachineBeginsToMove) {
  for (const bool begun : {false, true}) {
    ViewTaskSettings settings;
    Lab lab(settings);
    for (int i = 0; i < 5; ++i) {
      lab.frame();
      if (!begun) lab.last.setZero();  // Taken back.
    }
    CArmJoints elsewhere = lab.arm->state().joints;
    elsewhere[3] += 0.1;
    lab.arm = std::make_unique<SimulatedCArm>(lab.limits, elsewhere, lab.now_us);
    lab.in_transit.clear();
    lab.last.setZero();
    const TaskAnswer answer = lab.frame();
    EXPECT_EQ(answer.velocity.has_value(), !begun) << answer.hold_reason.value_or("");
    if (!begun) continue;
    EXPECT_NE(answer.hold_reason.value_or("").find("view.max_table_excursion_mm"), std::string::npos);
  }
}

TEST(ViewTask, IsNotReachedWhileItIsNotSure) {
  ViewTaskSettings settings;
  Lab lab(settings);
  lab.covariance = Matrix6d::Identity() * 4e-6;  // 2 mm, and more than 0.1 deg, also as a mean.
  EXPECT_FALSE(lab.settled_s());
  EXPECT_LT(radToDeg(lab.error.direction_rad), 0.1) << "it is there, only not sure";
}

TEST(ViewTask, HoldsBeforeAViewThatIsOutOfReach) {
  ViewTaskSettings settings;
  settings.primary_deg = 150;
  Lab lab(settings);
  const TaskAnswer answer = lab.frame();
  EXPECT_FALSE(answer.velocity);
  EXPECT_EQ(answer.hold_reason.value_or(""), "the view is out of the arm's reach");
}

TEST(ViewTask, RefusesAGoalThatIsNone) {
  ViewTaskSettings settings;
  settings.goal = ViewGoal::kPose;
  settings.T_camera_model.matrix()(0, 0) = 2;
  EXPECT_EQ(test::refusalOf([&] { Lab lab(settings); }), "view: T_camera_model: must be a pose");
  settings.goal = ViewGoal::kBestView;
  settings.branch = 1000;
  EXPECT_NE(test::refusalOf([&] { Lab lab(settings); }).find("branch = 1000"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/trajectory_preview.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

struct TrajectoryPreviews : testing::Test {
  test::Stage stage;
  ServoLoopSettings& settings = stage.settings;
  ViewTaskSettings& view = std::get<ViewTaskSettings>(settings.task);
  // A table that stands somewhere else than the view wants it.
  CArmJoints start() const {
    CArmJoints joints = stage.joints;
    joints.tail<3>() += Eigen::Vector3d(30e-3, -20e-3, 25e-3);
    return joints;
  }
};

TEST_F(TrajectoryPreviews, EndsAtTheViewAndGoesStraight) {
  view.primary_deg = 40;
  view.secondary_deg = -20;
  const TrajectoryPreview trajectory = previewTrajectory(settings, stage.tree, start());
  ASSERT_FALSE(trajectory.hold_reason) << *trajectory.hold_reason;
  EXPECT_EQ(trajectory.points.front().joints, start());
  EXPECT_LE(trajectory.points.back().view_off_rad, 1e-4);
  EXPECT_LE(trajectory.points.back().target_off_m, 1e-4);
  EXPECT_GT(trajectory.points.front().view_off_rad, degToRad(40));
  EXPECT_GT(trajectory.points.front().target_off_m, 30e-3);
  EXPECT_LT(trajectory.max_table_m, 0.1e-3);
  EXPECT_LT(trajectory.max_target_m, 0.1e-3);
  EXPECT_GT(trajectory.points.back().time_s, 1);
  for (const TrajectoryPoint& point : trajectory.points) {
    for (int i = 0; i < kCArmJointCount; ++i) {
      EXPECT_LE(std::abs(point.velocity[i]), settings.limits.velocity[i] * (1 + 1e-9));
    }
  }
}

TEST_F(TrajectoryPreviews, SayWhyTheTaskWouldNotArrive) {
  view.primary_deg = 150;
  const TrajectoryPreview beyond = previewTrajectory(settings, stage.tree, start());
  ASSERT_TRUE(beyond.hold_reason);
  EXPECT_NE(beyond.hold_reason->find("out of the arm's reach"), std::string::npos) << *beyond.hold_reason;
  // The camera's straight line is not the patient's.
  view.primary_deg = 100;
  view.secondary_deg = 30;
  settings.law = PositionBasedSettings{};
  const TrajectoryPreview wild = previewTrajectory(settings, stage.tree, stage.joints);
  ASSERT_TRUE(wild.hold_reason);
  EXPECT_NE(wild.hold_reason->find("_excursion_mm"), std::string::npos) << *wild.hold_reason;
  EXPECT_LT(wild.max_table_m, 40e-3) << "it ends where the task would";
}

TEST_F(TrajectoryPreviews, AreOfAViewThatIsKnown) {
  settings.task = CenterTaskSettings{};
  EXPECT_NE(test::refusalOf([&] { previewTrajectory(settings, stage.tree, start()); }).find("must be view"),
            std::string::npos);
  ViewTaskSettings requested;
  requested.goal = ViewGoal::kRequested;
  settings.task = requested;
  EXPECT_NE(test::refusalOf([&] { previewTrajectory(settings, stage.tree, start()); }).find("asked for"),
            std::string::npos);
}

}  // namespace
}  // namespace angio::test

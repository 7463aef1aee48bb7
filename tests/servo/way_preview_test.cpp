// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/servo/way_preview.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

struct WayPreviews : testing::Test {
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

TEST_F(WayPreviews, EndsAtTheViewAndGoesStraight) {
  view.primary_deg = 40;
  view.secondary_deg = -20;
  const WayPreview way = previewWay(settings, stage.tree, start());
  ASSERT_FALSE(way.hold_reason) << *way.hold_reason;
  EXPECT_EQ(way.points.front().joints, start());
  EXPECT_LE(way.points.back().view_off_rad, 1e-4);
  EXPECT_LE(way.points.back().target_off_m, 1e-4);
  EXPECT_GT(way.points.front().view_off_rad, degToRad(40));
  EXPECT_GT(way.points.front().target_off_m, 30e-3);
  EXPECT_LT(way.max_table_m, 0.1e-3);
  EXPECT_LT(way.max_target_m, 0.1e-3);
  EXPECT_GT(way.points.back().time_s, 1);
  for (const WayPoint& point : way.points) {
    for (int i = 0; i < kCArmJointCount; ++i) {
      EXPECT_LE(std::abs(point.velocity[i]), settings.limits.velocity[i] * (1 + 1e-9));
    }
  }
}

TEST_F(WayPreviews, SayWhyTheTaskWouldNotArrive) {
  view.primary_deg = 150;
  const WayPreview beyond = previewWay(settings, stage.tree, start());
  ASSERT_TRUE(beyond.hold_reason);
  EXPECT_NE(beyond.hold_reason->find("out of the arm's reach"), std::string::npos) << *beyond.hold_reason;
  // The camera's straight line is not the patient's.
  view.primary_deg = 100;
  view.secondary_deg = 30;
  settings.law = PositionBasedSettings{};
  const WayPreview wild = previewWay(settings, stage.tree, stage.joints);
  ASSERT_TRUE(wild.hold_reason);
  EXPECT_NE(wild.hold_reason->find("_excursion_mm"), std::string::npos) << *wild.hold_reason;
  EXPECT_LT(wild.max_table_m, 40e-3) << "it ends where the task would";
}

TEST_F(WayPreviews, AreOfAViewThatIsKnown) {
  settings.task = CenterTaskSettings{};
  EXPECT_NE(test::refusalOf([&] { previewWay(settings, stage.tree, start()); }).find("must be view"),
            std::string::npos);
  ViewTaskSettings requested;
  requested.goal = ViewGoal::kRequested;
  settings.task = requested;
  EXPECT_NE(test::refusalOf([&] { previewWay(settings, stage.tree, start()); }).find("asked for"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// A loop that another program asks for views.
#include <gtest/gtest.h>

#include "angio/messaging/recording_bus.hpp"
#include "angio/servo/replay.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

ServoLoopSettings requested(ServoLoopSettings settings) {
  settings = test::moving(settings);
  ViewTaskSettings view;
  view.goal = ViewGoal::kRequested;
  settings.task = view;
  return settings;
}

struct RequestedView : testing::Test {
  // One frame of the arm where it is, which then does what it is told.
  ServoReport frame(ServoNode& node) {
    ++k;
    publish(*bus, kCArmStateChannel, CArmState{k * kPeriod_us, k, stage.joints, last});
    publish(*bus, kXrayFrameChannel, stage.frame(k));
    handle();
    const auto report = node.answer(k * kPeriod_us);
    EXPECT_TRUE(report);
    handle();
    last = report->command.velocity;
    stage.joints += last * 1e-6 * kPeriod_us;
    return *report;
  }
  void handle() {
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
  }
  ViewRequest request(double primary_deg, std::int64_t sequence) const {
    ViewRequest view;
    view.time_us = k * kPeriod_us;
    view.sequence = sequence;
    view.model_id = modelId(stage.tree);
    view.beam_model = beamDirection({degToRad(primary_deg), 0});
    view.target_model = stage.tree.centroid();
    view.within_rad = degToRad(0.3);
    view.within_m = 1e-3;
    return view;
  }
  double offBeam_deg(const ViewRequest& view) const {
    const Pose T = stage.settings.carm.T_camera_patient(stage.joints);
    return radToDeg(std::acos(std::min(1.0, T.linear().row(2).dot(view.beam_model))));
  }

  test::Stage stage;
  test::TemporaryFolder folder;
  std::unique_ptr<Bus> bus = openBus("memq://");
  LatestMessage<ServoStatus> statuses{*bus, kServoStatusChannel};
  LatestMessage<RegistrationMessage> registrations{*bus, kRegistrationChannel};
  CArmJoints last = CArmJoints::Zero();
  std::int64_t k = 0;
};

TEST_F(RequestedView, IsReachedSaidAndReplayed) {
  const std::string log = folder.path("requested.lcm");
  const ServoLoopSettings settings = requested(stage.settings);
  {
    RecordingBus recorded(*bus, log);
    ServoNode node(recorded, settings, stage.tree);
    test::start(*bus, node);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(frame(node).hold_reason.value_or(""), "no view has been asked for");
    }
    EXPECT_EQ(registrations.received(), 0) << "a frame that nobody needs is not registered";

    for (const auto& [sequence, primary_deg] : {std::pair(1, 4.0), std::pair(2, -3.0)}) {
      const ViewRequest view = request(primary_deg, sequence);
      EXPECT_GT(offBeam_deg(view), 2);
      for (int i = 0; i < 100; ++i) {
        publish(*bus, kViewRequestChannel, view);  // Repeated, as its sender does.
        frame(node);
        if (statuses.peek()->view_reached_us == view.time_us) break;
      }
      EXPECT_EQ(statuses.peek()->view_reached_us, view.time_us) << statuses.peek()->reason;
      EXPECT_LT(offBeam_deg(view), 0.3);
      const auto registered = registrations.received();
      for (int i = 0; i < 3; ++i) {
        const ServoReport rests = frame(node);
        EXPECT_TRUE(rests.command.velocity.isZero(0));
        EXPECT_EQ(rests.hold_reason.value_or(""), "the view that was asked for is reached");
      }
      EXPECT_EQ(registrations.received(), registered);
    }
  }
  const ReplaySummary again = replay<ServoLoop>(log, {}, settings, stage.tree);
  EXPECT_EQ(again.answered, k);
  EXPECT_EQ(again.equal, again.commands) << again.first_difference.value_or("");
}

// Depth that one view leaves open holds a view that is measured by it, and none that is for looking.
TEST_F(RequestedView, IsReachedWhereDepthIsOpen) {
  ServoLoopSettings settings = test::moving(stage.settings);
  const auto answered = [&] {
    ServoInput input;
    input.state = stage.state(1);
    return ServoLoop(settings, stage.tree).propose(stage.frame(1), input);
  };
  const ServoReport first = answered();
  ASSERT_TRUE(first.observation.registration.covariance);
  const PatientObservation patient = PatientObservation::of(first.observation.registration);
  const Eigen::Vector3d target = stage.tree.centroid();
  ASSERT_GT(patient.worstStd_m(target), 2 * patient.worstStdAcross_m(target));
  settings.supervisor.max_target_std_mm =
      1e3 * std::sqrt(patient.worstStd_m(target) * patient.worstStdAcross_m(target));
  const auto held = answered().hold_reason;
  EXPECT_NE(held.value_or("").find("view and hold may not"), std::string::npos) << held.value_or("");

  ServoNode node(*bus, requested(settings), stage.tree);
  test::start(*bus, node);
  frame(node);
  const ViewRequest view = request(4, 1);
  for (int i = 0; i < 100 && statuses.peek()->view_reached_us != view.time_us; ++i) {
    publish(*bus, kViewRequestChannel, view);
    frame(node);
  }
  EXPECT_EQ(statuses.peek()->view_reached_us, view.time_us) << statuses.peek()->reason;
  EXPECT_LT(offBeam_deg(view), 0.3);
}

TEST_F(RequestedView, OfAnotherTreeIsNotObeyed) {
  ServoNode node(*bus, requested(stage.settings), stage.tree);
  test::start(*bus, node);
  ViewRequest view = request(4, 1);
  view.time_us = 1;
  view.model_id = static_cast<ModelId>(static_cast<std::int64_t>(view.model_id) + 1);
  publish(*bus, kViewRequestChannel, view);
  handle();
  const ServoReport report = frame(node);
  EXPECT_TRUE(report.command.velocity.isZero(0));
  EXPECT_EQ(report.hold_reason.value_or(""), "the view is asked for in another vessel tree");
}

// Who asks does not need the C-arm's permission, and does not give it either.
TEST_F(RequestedView, DoesNotArmTheCArm) {
  ServoNode node(*bus, requested(stage.settings), stage.tree);
  publish(*bus, kViewRequestChannel, request(4, 1));
  handle();
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(frame(node).command.velocity.isZero(0));
  EXPECT_EQ(node.states().state(), ServoState::kIdle);
}

}  // namespace
}  // namespace angio::test

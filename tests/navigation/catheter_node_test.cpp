// SPDX-License-Identifier: GPL-2.0-or-later
// The whole way over a bus, in simulated time: X-ray, C-arm, drive, and the node that steers.
#include "angio/navigation/catheter_node.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/core.hpp>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/io/vessel_files.hpp"
#include "angio/messaging/log_reader.hpp"
#include "angio/messaging/recording_bus.hpp"
#include "angio/servo/operator.hpp"
#include "angio/servo/replay.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/simulation/nodes.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/named_bus.hpp"
#include "angio/test/phantoms.hpp"
#include "angio/test/temporary_folder.hpp"
#include "angio/types/channels.hpp"

namespace angio::test {
namespace {

constexpr TreeLocation kStart{0, 30e-3};

// A liver's tree, and a C-arm whose detector has a quarter of the pixels; contrast agent at the beginning.
struct CatheterNodeTest : testing::Test {
  CatheterNodeTest() {
    CArmGeometry& carm = stage.carm;
    carm = calibration.carm;
    carm.image_width_px = carm.image_height_px = 512;
    carm.pixel_spacing_m *= 2;
    stage.T_dsa_cb = calibration.T_dsa_cb;
    SimulatedPatientSettings patient;
    patient.bolus.enabled = true;
    bus = openBus("memq://");
    const CArmJoints joints = carm.jointsFor({}, stage.T_dsa_cb * tree.centroid());
    arm = std::make_unique<SimulatedCArmNode>(*bus, stage.limits, joints, 0);
    xray = std::make_unique<SimulatedXrayNode>(tree, patient, carm, stage.T_dsa_cb);
    drive = std::make_unique<SimulatedCatheterNode>(*bus, tree, CatheterSettings(), kStart, 0);
    xray->show([this](const Eigen::Matrix3Xd& points) { return drive->catheter().device(points); });
    person = std::make_unique<Operator>(*bus, OperatedMachine::kCatheter);
  }

  std::unique_ptr<CatheterNode> nodeTo(const TreeLocation& target) {
    return std::make_unique<CatheterNode>(*bus, stage, tree, kStart, target, settings);
  }

  // One frame, and the answer to it; the command is there a frame later.
  std::optional<CatheterControllerReport> frame(CatheterNode& node) {
    now_us += 66'667;
    bus->handle(std::chrono::milliseconds(0));
    if (!deaf) drive->listen(now_us + ahead_us);
    if (spoil) {
      CArmState said = arm->arm().state();
      said.time_us = now_us;
      said.sequence = now_us / 66'667;
      spoil(said);
      publish(*bus, kCArmStateChannel, said);
    } else {
      arm->report(now_us);
    }
    drive->report(now_us + ahead_us);
    bus->handle(std::chrono::milliseconds(0));
    XrayFrame exposed = xray->render(now_us - late_us, arm->arm().state().joints);
    if (mirrored) cv::flip(exposed.image, exposed.image, 1);
    publish(*bus, kXrayFrameChannel, exposed);
    bus->handle(std::chrono::milliseconds(0));
    if (started) person->start(now_us);
    bus->handle(std::chrono::milliseconds(0));
    auto report = node.answer(now_us);
    if (table) {
      bus->handle(std::chrono::milliseconds(0));
      table_person->start(now_us);
      bus->handle(std::chrono::milliseconds(0));
      table->answer(now_us);
      bus->handle(std::chrono::milliseconds(0));
      arm->listen(now_us + 60'000);
    }
    return report;
  }

  // A node that steers, on its way to a branch.
  std::unique_ptr<CatheterNode> steering() {
    const TreeTopology map(tree);
    auto node = nodeTo({map.children(0).front(), 8e-3});
    for (int k = 0; k < 200 && node->states().state() != ServoState::kServo; ++k) frame(*node);
    EXPECT_EQ(node->states().state(), ServoState::kServo) << node->states().reason();
    return node;
  }

  // Some frames, in all of which the drive must rest.
  void expectRest(CatheterNode& node, int frames) {
    for (int k = 0; k < frames; ++k) {
      const auto report = frame(node);
      ASSERT_TRUE(report);
      EXPECT_TRUE(report->hold_reason);
      EXPECT_TRUE(report->command.insertion_speed_m_per_s == 0 && report->command.roll_speed_rad_per_s == 0 &&
                  report->command.bend_speed_rad_per_s == 0);
    }
  }

  // What a person does when the fault is mended: resets, arms, starts.
  bool steersAgain(CatheterNode& node) {
    person->ask(ServoRequestKind::kReset, now_us);
    frame(node);
    person = std::make_unique<Operator>(*bus, OperatedMachine::kCatheter);
    for (int k = 0; k < 40 && node.states().state() != ServoState::kServo; ++k) frame(node);
    return node.states().state() == ServoState::kServo;
  }

  // The C-arm's loop, which keeps the tip in the middle by the table, and does not look at frames itself.
  void centerTheTip() {
    ServoLoopSettings loop;
    loop.carm = stage.carm;
    loop.limits = stage.limits;
    loop.T_dsa_cb = stage.T_dsa_cb;
    loop.external_registration = true;
    loop.latency_s = 0.06;
    CenterTaskSettings center;
    center.on = CenterOn::kCatheterTip;
    loop.task = center;
    table = std::make_unique<ServoNode>(*bus, loop, tree);
    table_person = std::make_unique<Operator>(*bus);
  }

  // How far the true tip is from the middle of the image, at the isocentre.
  double offMiddle_m() const {
    const Device device = drive->catheter().device(tree.points());
    const Eigen::Vector3d tip = stage.carm.T_camera_patient(arm->arm().state().joints) *
                                (stage.T_dsa_cb * Eigen::Vector3d(device.points.rightCols<1>()));
    return tip.head<2>().norm() * stage.carm.source_isocenter_distance_m / tip.z();
  }

  VesselTree tree = readVesselTree(test::exampleData("hepatic-tace/tree.csv"));
  CArmCalibration calibration = readCArmCalibration(test::exampleData("hepatic-tace/carm.yaml"));
  CArmSetup stage;
  CatheterControllerSettings settings;
  std::unique_ptr<Bus> bus;
  std::unique_ptr<SimulatedCArmNode> arm;
  std::unique_ptr<SimulatedXrayNode> xray;
  std::unique_ptr<SimulatedCatheterNode> drive;
  std::unique_ptr<Operator> person, table_person;
  std::unique_ptr<ServoNode> table;
  std::int64_t now_us = 0, ahead_us = 0, late_us = 0;
  std::function<void(CArmState&)> spoil;  // What is wrong with the arm's reports.
  bool started = true, deaf = false, mirrored = false;
};

TEST_F(CatheterNodeTest, MakesARoadmapAndPushesOnOnceTheVesselsHaveWashedOut) {
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  const LatestMessage<CatheterTip> tips(*bus, kCatheterTipChannel);
  bool mapped = false, navigated = false;
  for (int k = 0; k < 240; ++k) {
    const auto report = frame(*node);
    ASSERT_TRUE(report);
    if (report->roadmap) {
      mapped = true;
      EXPECT_TRUE(report->hold_reason);
      EXPECT_EQ(report->command.insertion_speed_m_per_s, 0);
    }
    navigated = navigated || !report->hold_reason;
  }
  EXPECT_TRUE(mapped);
  EXPECT_TRUE(navigated);
  bus->handle(std::chrono::milliseconds(0));
  const CatheterTruth truth = drive->catheter().truth();
  EXPECT_GT(truth.path_m, kStart.arc_m + 5e-3);
  ASSERT_TRUE(tips.peek());
  EXPECT_NE(tips.peek()->status, CatheterTipStatus::kLost) << tips.peek()->reason;
  EXPECT_NEAR(tips.peek()->arc_length_m, truth.path_m, 3e-3);

  // The C-arm turns: what the roadmap said is over, and the drive rests for as long as there is no other.
  CArmCommand turn;
  turn.time_us = now_us;
  turn.sequence = 1;
  turn.valid_for_us = 1'000'000;
  turn.velocity[0] = 0.1;
  publish(*bus, kCArmCommandChannel, turn);
  bus->handle(std::chrono::milliseconds(0));
  arm->listen(now_us);
  const double before_m = truth.path_m;
  for (int k = 0; k < 15; ++k) {
    const auto report = frame(*node);
    ASSERT_TRUE(report);
    EXPECT_TRUE(k <= 3 || report->hold_reason) << k;
  }
  EXPECT_LT(drive->catheter().truth().path_m - before_m, 4e-3);
}

TEST_F(CatheterNodeTest, StandsStillUntilItIsStartedAndWhenItIsStopped) {
  started = false;
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  for (int k = 0; k < 100; ++k) {
    const auto report = frame(*node);
    ASSERT_TRUE(report);
    ASSERT_TRUE(report->hold_reason);
    ASSERT_EQ(report->command.insertion_speed_m_per_s, 0);
  }
  EXPECT_EQ(drive->catheter().truth().path_m, kStart.arc_m);
  started = true;
  bool moved = false;
  for (int k = 0; k < 30; ++k) moved = !frame(*node)->hold_reason || moved;
  EXPECT_TRUE(moved);
  Operator(*bus).ask(ServoRequestKind::kStop, now_us);
  frame(*node);
  EXPECT_NE(node->states().state(), ServoState::kIdle) << "that was for the C-arm";
  Operator(*bus).ask(ServoRequestKind::kEmergencyStop, now_us);  // One is for all.
  for (int k = 0; k < 5; ++k) {
    const auto report = frame(*node);
    EXPECT_TRUE(report->hold_reason);
    EXPECT_EQ(report->command.insertion_speed_m_per_s, 0);
  }
  EXPECT_EQ(node->states().state(), ServoState::kEmergencyStop);
}

TEST_F(CatheterNodeTest, TheTableKeepsTheTipInTheMiddleOnItsRoute) {
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  centerTheTip();
  const CArmJoints before = arm->arm().state().joints;
  double worst_m = 0, sum2 = 0;
  int counted = 0, steered = 0;
  for (int k = 0; k < 300; ++k) {
    const auto report = frame(*node);
    if (report && !report->hold_reason) ++steered;
    if (steered < 60) continue;  // Until then it has come there from the side.
    const double off_m = offMiddle_m();
    worst_m = std::max(worst_m, off_m);
    sum2 += off_m * off_m;
    ++counted;
  }
  ASSERT_GT(counted, 60);
  EXPECT_EQ(table->safety().states().state(), ServoState::kServo) << table->safety().states().reason();
  EXPECT_GT((arm->arm().state().joints - before).tail<3>().norm(), 20e-3);
  EXPECT_EQ((arm->arm().state().joints - before).head<2>().norm(), 0);
  EXPECT_LT(std::sqrt(sum2 / counted), 2e-3);
  EXPECT_LT(worst_m, 5e-3);
  EXPECT_GT(drive->catheter().truth().path_m, kStart.arc_m + 5e-3) << "and the catheter goes on";
}

// With frames that were looked at and answered, and others whose answers were not let out.
TEST_F(CatheterNodeTest, IsReplayedBitForBit) {
  const test::TemporaryFolder folder;
  const std::string log = folder.path("run.lcm");
  const TreeTopology map(tree);
  const TreeLocation target{map.children(0).front(), 8e-3};
  {
    RecordingBus recorded(*bus, log);
    CatheterNode node(recorded, stage, tree, kStart, target, settings);
    started = false;
    for (int k = 0; k < 85; ++k) frame(node);
    started = true;
    for (int k = 0; k < 30; ++k) frame(node);
    Operator(*bus, OperatedMachine::kCatheter).ask(ServoRequestKind::kEmergencyStop, now_us);
    for (int k = 0; k < 5; ++k) frame(node);
  }
  int moving = 0;
  const auto count = [&](const ReplayedFrame<CatheterController>& f) {
    moving += f.report.command.insertion_speed_m_per_s != 0;
  };
  const ReplaySummary same = replay<CatheterController>(log, count, stage, tree, kStart, target, settings);
  EXPECT_EQ(same.answered, 120);
  EXPECT_EQ(same.commands, 120);
  EXPECT_EQ(same.equal, 120) << same.first_difference.value_or("");
  EXPECT_FALSE(same.first_difference);
  EXPECT_GT(moving, 10);
  EXPECT_GT(same.held, 85);

  settings.loop.navigator.speed_mm_per_s *= 0.5;
  const ReplaySummary slower = replay<CatheterController>(log, {}, stage, tree, kStart, target, settings);
  ASSERT_TRUE(slower.first_difference);
  // A slower push may go on for longer before it could come to too much force.
  EXPECT_NE(slower.first_difference->find("valid_for_us = "), std::string::npos) << *slower.first_difference;

  const std::string other = folder.path("other.lcm");
  {
    const auto out = openBus("file://" + other + "?mode=w");
    LogReader in(log);
    for (auto event = in.next(); event; event = in.next()) {
      if (event->channel != kCatheterInputChannel) out->publish(event->channel, event->bytes);
    }
  }
  // Without CATHETER_INPUT the arm and the drive are read from what had been heard before each frame.
  const ReplaySummary guessed = replay<CatheterController>(other, {}, stage, tree, kStart, target, settings);
  EXPECT_FALSE(guessed.knew_inputs);
  EXPECT_EQ(guessed.answered, 120);
}

TEST_F(CatheterNodeTest, CallsADriveThatDoesNotObeyAFault) {
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  double pushed_m = 0;
  for (int k = 0; k < 200 && pushed_m < 1e-3; ++k) {
    frame(*node);
    pushed_m = drive->catheter().state().insertion_m - kStart.arc_m;
  }
  ASSERT_EQ(node->states().state(), ServoState::kServo);
  deaf = true;
  int frames = 0;
  for (; frames < 90 && node->states().state() != ServoState::kFault; ++frames) frame(*node);
  ASSERT_EQ(node->states().state(), ServoState::kFault) << node->states().reason();
  EXPECT_NE(node->states().reason().find("insertion lags behind its commands"), std::string::npos)
      << node->states().reason();
  // A command stays possibly in force for 0.5 s; then 10 mm at 4 to 12 mm/s.
  EXPECT_GE(frames, 15);
  for (int k = 0; k < 3; ++k) {
    const auto report = frame(*node);
    EXPECT_TRUE(report->hold_reason);
    EXPECT_EQ(report->command.insertion_speed_m_per_s, 0);
  }
}

// A delay that never changes shows against the arm's reports only, whose clock is the frames'.
TEST_F(CatheterNodeTest, RestsOnFramesThatAreLateThroughout) {
  const LatestMessage<ServoStatus> statuses(*bus, kCatheterStatusChannel);
  late_us = 250'000;
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  for (int k = 0; k < 10; ++k) frame(*node);  // The arm has been heard from before the first frame on.
  expectRest(*node, 100);
  bus->handle(std::chrono::milliseconds(0));
  EXPECT_EQ(node->states().state(), ServoState::kHold);
  EXPECT_NE(statuses.peek()->reason.find("250 ms later than the newest joints"), std::string::npos)
      << statuses.peek()->reason;
  EXPECT_EQ(drive->catheter().truth().path_m, kStart.arc_m);
}

TEST_F(CatheterNodeTest, CallsJointsThatCannotBeAFault) {
  const LatestMessage<ServoStatus> statuses(*bus, kCatheterStatusChannel);
  const auto node = steering();
  spoil = [](CArmState& said) { said.joints[0] = 40; };  // Degrees.
  expectRest(*node, 5);
  bus->handle(std::chrono::milliseconds(0));
  EXPECT_EQ(statuses.peek()->state, ServoState::kFault);
  EXPECT_EQ(statuses.peek()->cause, ServoCause::kJointsImplausible);
  EXPECT_NE(statuses.peek()->reason.find("primary at 40, far out of its range"), std::string::npos)
      << statuses.peek()->reason;
  spoil = nullptr;
  expectRest(*node, 5);
  EXPECT_TRUE(steersAgain(*node)) << node->states().reason();
}

TEST_F(CatheterNodeTest, CallsAnArmWhoseClockGoesBackAFault) {
  const LatestMessage<ServoStatus> statuses(*bus, kCatheterStatusChannel);
  const auto node = steering();
  spoil = [](CArmState& said) { said.time_us -= 10'000'000; };
  expectRest(*node, 5);
  bus->handle(std::chrono::milliseconds(0));
  EXPECT_EQ(statuses.peek()->state, ServoState::kFault);
  EXPECT_EQ(statuses.peek()->cause, ServoCause::kClockJumped);
  EXPECT_NE(statuses.peek()->reason.find("joints went on by -99"), std::string::npos) << statuses.peek()->reason;
  EXPECT_FALSE(steersAgain(*node)) << "frames and joints are not of one time";
  spoil = nullptr;
  EXPECT_TRUE(steersAgain(*node)) << node->states().reason();
}

TEST_F(CatheterNodeTest, SaysThatTheImageIsMirrored) {
  mirrored = true;
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  std::string why;
  for (int k = 0; k < 60 && why.find("matches when") == std::string::npos; ++k) {
    const auto report = frame(*node);
    ASSERT_TRUE(report && report->hold_reason);
    why = *report->hold_reason;
  }
  EXPECT_NE(why.find("the image matches when mirrored left to right"), std::string::npos) << why;
}

// Frames are on their way for longer than the drive takes between two reports.
TEST_F(CatheterNodeTest, ReadsAFrameWithTheDriveOfItsOwnTime) {
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  const LatestMessage<CatheterInput> inputs(*bus, kCatheterInputChannel);
  ahead_us = 200'000;
  int answered = 0;
  for (int k = 0; k < 110; ++k) {
    const auto report = frame(*node);
    ASSERT_TRUE(report);
    bus->handle(std::chrono::milliseconds(0));
    ASSERT_TRUE(inputs.peek());
    answered += !report->hold_reason;
    if (k > 3) {  // The drive has been heard from before the frame on.
      EXPECT_EQ(inputs.peek()->drive.time_us, now_us);
    }
  }
  EXPECT_GT(answered, 5);
}

// Without somebody who goes there, the drive rests; what is asked for is repeated, once the catheter has been started.
TEST_F(CatheterNodeTest, AsksForAViewAndRestsUntilItIsReached) {
  settings.ask_for_views = true;
  const TreeTopology map(tree);
  const auto node = nodeTo({map.children(0).front(), 8e-3});
  LatestMessage<ViewRequest> requests(*bus, kViewRequestChannel);
  started = false;
  expectRest(*node, 5);
  bus->handle(std::chrono::milliseconds(0));
  EXPECT_EQ(requests.received(), 0) << "a catheter that is not started asks for nothing";
  started = true;
  expectRest(*node, 100);  // Until the contrast agent has washed out.
  bus->handle(std::chrono::milliseconds(0));
  ASSERT_TRUE(requests.peek());
  const ViewRequest first = *requests.peek();
  EXPECT_GT(requests.received(), 10);
  EXPECT_EQ(first.sequence, 1);
  EXPECT_NEAR(first.beam_model.norm(), 1, 1e-12);
  EXPECT_EQ(first.model_id, modelId(tree));
  EXPECT_NE(node->states().reason().find("waits for a view"), std::string::npos) << node->states().reason();

  // The C-arm's loop says that it is there; no roadmap comes of it, and the view is asked for again.
  ServoStatus there;
  there.view_reached_us = first.time_us;
  for (int k = 0; k < 200 && requests.peek()->sequence == 1; ++k) {
    there.frame_sequence = k + 1;
    there.time_us = now_us;
    publish(*bus, kServoStatusChannel, there);
    frame(*node);
    bus->handle(std::chrono::milliseconds(0));
  }
  EXPECT_EQ(requests.peek()->sequence, 2);
  EXPECT_EQ(requests.peek()->reason, "the last one has given no roadmap");
  EXPECT_EQ(requests.peek()->beam_model, first.beam_model);
  EXPECT_EQ(drive->catheter().truth().path_m, kStart.arc_m);
}

TEST_F(CatheterNodeTest, RefusesPlacesThatTheTreeDoesNotHave) {
  EXPECT_NE(test::refusalOf([&] { nodeTo({1000, 0}); }).find("target = 1000"), std::string::npos);
}

TEST_F(CatheterNodeTest, SaysWhatIsWrongOnItsBusAndWhoSendsIt) {
  NamedBus named;
  const TreeLocation target{TreeTopology(tree).children(0).front(), 8e-3};
  CatheterNode node(named, stage, tree, kStart, target, settings);
  const auto trouble = [&](const std::function<void(std::int64_t)>& say) {
    for (int i = 0; i < 20; ++i) {
      now_us += 66'667;
      say(now_us / 66'667);
      while (named.handle(std::chrono::milliseconds(0)) > 0) continue;
      node.answer(now_us);
    }
    return node.trouble().value_or("");
  };
  const std::string undecodable =
      trouble([&](std::int64_t) { named.another("10.0.0.1:1", kXrayFrameChannel, encode(CatheterState())); });
  EXPECT_NE(undecodable.find(" messages on XRAY_FRAME from 10.0.0.1:1 cannot be decoded: xray_frame_t: another type's "
                             "fingerprint, catheter_state_t's"),
            std::string::npos)
      << undecodable;
  ++now_us;
  CatheterState drive_state;
  drive_state.time_us = 1'763'938'257'000'000;
  drive_state.sequence = 1;
  CArmState at{now_us, 1, CArmJoints::Zero(), CArmJoints::Zero()};
  at.joints = arm->arm().state().joints;
  named.another("10.0.0.1:4", kCatheterStateChannel, encode(drive_state));
  named.another("10.0.0.1:5", kCArmStateChannel, encode(at));
  named.another("10.0.0.1:1", kXrayFrameChannel, encode(xray->render(now_us, at.joints)));
  named.handle(std::chrono::milliseconds(0));
  const auto report = node.answer(now_us);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->hold_reason.value_or("").find("the clocks of XRAY_FRAME from 10.0.0.1:1 and CATHETER_STATE from "
                                                  "10.0.0.1:4 count from different epochs: utime "),
            0u)
      << report->hold_reason.value_or("");
  const std::string two = trouble([&](std::int64_t k) {
    for (const std::string sender : {"10.0.0.1:2", "10.0.0.1:3"}) {
      CatheterState state;
      state.time_us = now_us - 100;
      state.sequence = k;
      named.another(sender, kCatheterStateChannel, encode(state));
    }
  });
  EXPECT_EQ(two, "two catheter drives on CATHETER_STATE: 10.0.0.1:2 and 10.0.0.1:3: stop one");
}

}  // namespace
}  // namespace angio::test

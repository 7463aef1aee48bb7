// SPDX-License-Identifier: GPL-2.0-or-later
// A loop that is told by other programs what its frames show.
#include <gtest/gtest.h>

#include <limits>

#include "angio/messaging/recording_bus.hpp"
#include "angio/perception/perception_node.hpp"
#include "angio/servo/replay.hpp"
#include "angio/servo/servo_node.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/temporary_folder.hpp"
#include "stage.hpp"

namespace angio::test {
namespace {

// A perception node and a loop on one bus, before an arm that stands where it is.
struct ToldLoop : testing::Test {
  void expose(std::int64_t k, bool seen = true) {
    publish(*bus, kCArmStateChannel, stage.state(k));
    publish(*bus, kXrayFrameChannel, stage.frame(k));
    handle();
    if (seen) eyes.observe();
    handle();
  }
  void handle() {
    while (bus->handle(std::chrono::milliseconds(0)) > 0) continue;
  }
  static ServoLoopSettings told(ServoLoopSettings settings) {
    settings.external_registration = true;
    return settings;
  }

  test::Stage stage;
  test::TemporaryFolder folder;
  std::string log = folder.path("told.lcm");
  std::unique_ptr<Bus> bus = openBus("memq://");
  PerceptionNode eyes{*bus, stage.settings.gatedPerception(), stage.tree};
};

TEST_F(ToldLoop, DoesAsOneThatLooksItselfAndIsReplayed) {
  ServoLoopSettings settings = test::moving(stage.settings);
  const auto other_bus = openBus("memq://");
  ServoNode looking(*other_bus, settings, stage.tree);
  test::start(*other_bus, looking);
  {
    RecordingBus recorded(*bus, log);  // Whole when it ends.
    ServoNode node(recorded, told(settings), stage.tree);
    const LatestMessage<RegistrationMessage> said(*bus, kRegistrationChannel);
    test::start(*bus, node);
    for (std::int64_t k = 1; k <= 4; ++k) {
      expose(k);
      const auto report = node.answer(k * kPeriod_us);
      ASSERT_TRUE(report);
      EXPECT_FALSE(report->hold_reason) << *report->hold_reason;
      publish(*other_bus, kCArmStateChannel, stage.state(k));
      publish(*other_bus, kXrayFrameChannel, stage.frame(k));
      while (other_bus->handle(std::chrono::milliseconds(0)) > 0) continue;
      const auto expected = looking.answer(k * kPeriod_us);
      EXPECT_FALSE(report->command.velocity.isZero(0));
      EXPECT_TRUE(report->command.velocity.isApprox(expected->command.velocity, 1e-9));
      handle();
      EXPECT_EQ(said.received(), k) << "the loop does not repeat what it was told";
    }
  }
  const ReplaySummary again = replay<ServoLoop>(log, {}, told(settings), stage.tree);
  EXPECT_EQ(again.answered, 4);
  EXPECT_EQ(again.equal, 4) << again.first_difference.value_or("");
}

// One row a point, of the error where the pose puts it; and nothing that a bus would refuse.
TEST_F(ToldLoop, IsToldHowUncertainEachPointIs) {
  publish(*bus, kCArmStateChannel, stage.state(1));
  publish(*bus, kXrayFrameChannel, stage.frame(1));
  handle();
  const auto seen = eyes.observe();
  ASSERT_TRUE(seen && !seen->rejection);
  RegistrationResult registration = seen->observation.registration;
  const auto said = registrationPoints(registration, stage.tree, seen->observation.model_id, kPeriod_us, 1);
  ASSERT_TRUE(said);
  ASSERT_EQ(said->covariance.cols(), stage.tree.size());
  EXPECT_NO_THROW(encode(*said));
  const PatientObservation patient = PatientObservation::of(registration);
  for (Eigen::Index i = 0; i < stage.tree.size(); i += 7) {
    const Eigen::Matrix3d C = patient.pointCovariance(stage.tree.points().col(i));
    const auto six = said->covariance.col(i).cast<double>().eval();
    Eigen::Matrix3d row;
    row << six[0], six[1], six[2], six[1], six[3], six[4], six[2], six[4], six[5];
    EXPECT_LE((row - C).norm(), 1e-6 * C.norm()) << "point " << i;
    EXPECT_GT(six[5], six[0]) << "depth is what one view shows least";
  }
  registration.points.reset();
  (*registration.covariance)(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(registrationPoints(registration, stage.tree, seen->observation.model_id, kPeriod_us, 1));
  registration.covariance.reset();
  EXPECT_FALSE(registrationPoints(registration, stage.tree, seen->observation.model_id, kPeriod_us, 1));
}

TEST_F(ToldLoop, StandsStillWhereNobodySaysAnything) {
  ServoNode node(*bus, told(test::moving(stage.settings)), stage.tree);
  test::start(*bus, node);
  expose(1);
  ASSERT_TRUE(node.answer(kPeriod_us));
  ASSERT_EQ(node.safety().states().state(), ServoState::kServo);
  std::int64_t k = 2;
  for (; k < 12; ++k) {
    expose(k, false);
    EXPECT_FALSE(node.answer(k * kPeriod_us));
  }
  EXPECT_EQ(node.safety().states().state(), ServoState::kHold) << node.safety().states().reason();
  for (; k < 60; ++k) {
    expose(k, false);
    node.answer(k * kPeriod_us);
  }
  EXPECT_EQ(node.safety().states().state(), ServoState::kFault);
}

TEST_F(ToldLoop, BelievesNoRegistrationWithoutACovariance) {
  ServoLoop loop(told(stage.settings), stage.tree);
  ExternalEstimates seen;
  seen.registration.emplace();
  seen.registration->model_id = modelId(stage.tree);
  seen.registration->T_camera_model = stage.settings.carm.T_camera_patient(stage.joints);
  const ServoReport report = loop.step(stage.frame(1), stage.state(1), seen);
  EXPECT_EQ(report.hold_reason.value_or(""), "registration is not finite");
  EXPECT_EQ(loop.step(stage.frame(2), stage.state(2)).hold_reason.value_or(""), "nobody has registered the frame");
}

// A perception node that was started with another patient's tree, and finds that.
TEST_F(ToldLoop, DoesNotGoByAnotherTree) {
  Eigen::Matrix3Xd points = stage.tree.points();
  points(1, 3) += 1e-5;
  const VesselTree other(points, stage.tree.parents(), stage.tree.radii());
  PerceptionNode others_eyes(*bus, stage.settings.gatedPerception(), other);
  const LatestMessage<RegistrationMessage> said(*bus, kRegistrationChannel);
  ServoNode node(*bus, told(test::moving(stage.settings)), stage.tree);
  test::start(*bus, node);
  expose(1, false);
  const auto seen = others_eyes.observe();
  ASSERT_TRUE(seen && !seen->rejection);
  handle();
  const auto report = node.answer(kPeriod_us);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->hold_reason.value_or(""), "what was registered is another vessel tree");
  EXPECT_TRUE(report->command.velocity.isZero(0));
  expose(2);
  const auto own = node.answer(2 * kPeriod_us);
  ASSERT_TRUE(own);
  EXPECT_FALSE(own->hold_reason) << *own->hold_reason;
}

// The table goes where the tip is, and rests where nobody knows.
TEST_F(ToldLoop, CentersACathetersTip) {
  ServoLoopSettings settings = stage.settings;
  CenterTaskSettings center;
  center.on = CenterOn::kCatheterTip;
  settings.task = center;
  EXPECT_TRUE(settings.externalInputs().tip);
  const Pose truth = settings.carm.T_camera_patient(stage.joints);
  for (const double side : {-1.0, 1.0}) {
    ServoLoop loop(settings, stage.tree);
    ExternalEstimates seen;
    seen.tip.emplace();
    seen.tip->reason = "it is behind a rib";
    ServoReport report = loop.step(stage.frame(1), stage.state(1), seen);
    EXPECT_EQ(report.hold_reason.value_or(""), "the catheter's tip is not located: it is behind a rib");
    EXPECT_FALSE(report.contradicts);
    EXPECT_TRUE(report.command.velocity.isZero(0));
    // To the right in the image, or to the left: the patient has to go the other way.
    seen.tip->status = CatheterTipStatus::kLocated;
    report = loop.step(stage.frame(1), stage.state(1), seen);
    EXPECT_EQ(report.hold_reason.value_or(""), "the catheter's tip was located in another vessel tree");
    seen.tip->model_id = modelId(stage.tree);
    seen.tip->tip_model = truth.inverse() * (truth * stage.tree.centroid() + Eigen::Vector3d(side * 0.02, 0, 0));
    seen.tip->covariance = 1e-6 * Eigen::Matrix3d::Identity();
    for (std::int64_t k = 2; k <= 6; ++k) {
      report = loop.step(stage.frame(k), stage.state(k), seen);
      ASSERT_FALSE(report.hold_reason) << *report.hold_reason;
    }
    EXPECT_NEAR(report.task.pixel_error->x(),
                side * 0.02 * settings.carm.camera().parameters().fx_px / (truth * stage.tree.centroid()).z(), 2);
    EXPECT_TRUE(report.command.velocity.head<2>().isZero(0));
    const Eigen::Vector3d table = report.command.velocity.tail<3>();
    const Eigen::Vector3d moves = settings.carm.eJe(stage.joints).block<3, 3>(0, 2) * table;
    EXPECT_GT(side * moves.x(), 1e-3) << "the camera against the patient";
  }
}

}  // namespace
}  // namespace angio::test

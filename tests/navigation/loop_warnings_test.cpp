// SPDX-License-Identifier: GPL-2.0-or-later
// What a loop's program tells on stderr beside its answers to frames.
#include "loop_warnings.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "angio/navigation/catheter_controller.hpp"
#include "angio/simulation/fluoroscopy.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/phantoms.hpp"

namespace angio::test {
namespace {

struct ToldNode {
  std::optional<std::string> said, focal;
  const std::optional<std::string>& trouble() const { return said; }
  const ToldNode& loop() const { return *this; }
  std::optional<std::string> focalLengthWarning() const { return focal; }
};

TEST(LoopWarnings, TellEachCauseOnceAndAgainWhenItComesBack) {
  apps::LoopWarnings warnings("angio-navigate");
  const auto told = [&](const ToldNode& node) {
    testing::internal::CaptureStderr();
    warnings.tell(node);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(told({}), "");
  EXPECT_EQ(told({"2 messages on X", {}}), "angio-navigate: 2 messages on X\n");
  EXPECT_EQ(told({"3 messages on X", {}}), "") << "other numbers only";
  EXPECT_EQ(told({"nothing on X", {}}), "angio-navigate: nothing on X\n");
  EXPECT_EQ(told({{}, "too long"}), "angio-navigate: too long\n");
  EXPECT_EQ(told({"nothing on X", "too long by more"}), "angio-navigate: nothing on X\n");
}

// Frames and calibration are wrong alike, so that nothing else can notice.
TEST(LoopWarnings, ACathetersControllerNoticesAFocalLengthThatIsTooLong) {
  const VesselTree tree = branchingTree(6);
  CArmSetup truth;
  truth.carm.pixel_spacing_m = 0.5e-3;
  truth.carm.image_width_px = truth.carm.image_height_px = 448;
  CArmSetup wrong = truth;
  wrong.carm.source_detector_distance_m *= 1.04;
  const FluoroscopySettings look;
  FluoroscopyRenderer renderer(withPlausibleRadii(tree, look.end_radius_mm * 1e-3), look);
  CatheterControllerSettings settings;
  settings.perception.search_starts.count = 3;
  const TreeLocation target{TreeTopology(tree).children(0).front(), 5e-3};
  CatheterController controller(wrong, tree, {0, 10e-3}, target, settings);
  EXPECT_FALSE(controller.focalLengthWarning());
  for (std::int64_t k = 1; k <= 64 && !controller.focalLengthWarning(); ++k) {  // A walk over the views.
    const double step = 0.1 * static_cast<double>(k);
    CArmState arm;
    arm.joints =
        truth.carm.jointsFor({degToRad(55 * std::sin(step)), degToRad(28 * std::sin(2.3 * step))}, tree.centroid());
    arm.time_us = 66'667 * k;
    arm.sequence = k;
    CatheterState drive;
    drive.time_us = arm.time_us;
    drive.sequence = k;
    XrayFrame frame{arm.time_us, k, {}, wrong.carm.camera()};
    frame.image =
        renderer.render(truth.carm.camera(), truth.carm.T_camera_patient(arm.joints), static_cast<std::uint64_t>(k));
    const auto report = controller.propose(frame, {arm.time_us, k, ServoVerdict::kPermitted, arm, drive, 0});
    controller.commit(report.command);
    controller.learn();
  }
  ASSERT_TRUE(controller.focalLengthWarning());
  EXPECT_NE(controller.focalLengthWarning()->find("too long"), std::string::npos) << *controller.focalLengthWarning();
}

}  // namespace
}  // namespace angio::test

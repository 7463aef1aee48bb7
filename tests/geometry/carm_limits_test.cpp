// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/geometry/carm_limits_settings.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/geometry/se3.hpp"
#include "angio/test/errors.hpp"

namespace angio::test {
namespace {

TEST(CArmLimitsSettings, AreTheSameNumbersInRadiansAndMetres) {
  CArmLimitsSettings settings;
  settings.secondary_deg[0] = -45;
  settings.angle_jerks_deg_s3[1] = 90;
  settings.table_y_mm[1] = 120;
  settings.table_speeds_mm_per_s[2] = 50;
  const CArmLimits limits = settings.limits(0.303);
  EXPECT_DOUBLE_EQ(limits.lower[1], -kPi / 4);
  EXPECT_DOUBLE_EQ(limits.jerk[1], kPi / 2);
  EXPECT_DOUBLE_EQ(limits.upper[3], 0.12);
  EXPECT_DOUBLE_EQ(limits.velocity[4], 0.05);
  // What was not given is the usual.
  EXPECT_DOUBLE_EQ(limits.upper[0], degToRad(120));
  EXPECT_DOUBLE_EQ(limits.acceleration[2], 0.2);
  EXPECT_FALSE(limits.envelope.faces.empty());
  settings.envelope = CArmLimitsSettings::Envelope::kNone;
  EXPECT_TRUE(settings.limits(0).envelope.faces.empty());
}

TEST(CArmLimitsSettings, RefuseWhatNoMachineIs) {
  CArmLimitsSettings settings;
  EXPECT_EQ(test::refusalOf([&] { settings.limits(0); }),
            "c-arm envelope: isocentre_detector_mm = 0: must be a positive number");
  settings.table_x_mm[1] = -300;
  EXPECT_EQ(test::refusalOf([&] { settings.limits(0.3); }),
            "limits: table_x_mm = -300, -300: must go up from the least to the most");
  settings.table_speeds_mm_per_s[1] = 0;
  EXPECT_NE(test::refusalOf([&] { checkSettings("limits", settings); }).find("table_speeds_mm_per_s"),
            std::string::npos);
}

}  // namespace
}  // namespace angio::test

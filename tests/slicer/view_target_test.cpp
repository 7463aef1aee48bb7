// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/slicer/view_target.hpp"

#include <gmock/gmock.h>

#include "angio/test/namespace.hpp"

namespace angio::test {
namespace {

TEST(ViewTarget, ReadsAnglesAndPlacesEitherWayRound) {
  const auto target = std::get<ViewTarget>(readViewTarget("  rao_deg 30 cra_deg 15.5 r_mm 12 a_mm -3 s_mm 40"));
  EXPECT_DOUBLE_EQ(target.angles->primary_rad, degToRad(-30));
  EXPECT_DOUBLE_EQ(target.angles->secondary_rad, degToRad(15.5));
  EXPECT_LT((*target.target_lps_m - Eigen::Vector3d(-0.012, 0.003, 0.040)).norm(), 1e-15);
  EXPECT_FALSE(std::get<ViewTarget>(readViewTarget("l_mm 1 p_mm 2 i_mm 3")).angles);
}

TEST(ViewTarget, SaysWhatIsWrong) {
  const auto why = [](const std::string& text) { return std::get<std::string>(readViewTarget(text)); };
  EXPECT_THAT(why(""), testing::HasSubstr("must have angles or coordinates"));
  EXPECT_THAT(why("lao_deg 30"), testing::HasSubstr("must be both or none"));
  EXPECT_THAT(why("r_mm 1 a_mm 2"), testing::HasSubstr("must be all three or none"));
  EXPECT_THAT(why("lao_deg 30 rao_deg 30 cra_deg 1"), testing::HasSubstr("rao_deg: is said twice"));
  EXPECT_THAT(why("lao_deg thirty cra_deg 1"), testing::HasSubstr("lao_deg = thirty"));
  EXPECT_THAT(why("lao_deg nan cra_deg 1"), testing::HasSubstr("lao_deg = nan"));
  EXPECT_THAT(why("lao_deg 30 cra_deg"), testing::HasSubstr("cra_deg: needs a number"));
  EXPECT_THAT(why("zoom 3"), testing::HasSubstr("zoom: must be one of"));
}

}  // namespace
}  // namespace angio::test

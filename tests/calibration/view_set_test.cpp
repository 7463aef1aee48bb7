// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/view_set.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"

namespace angio::test {
namespace {

const std::string kHead =
    "machine: lab-1\nphantom: helix.yaml\nimage_size_px: [640, 480]\npixel_spacing_mm: 0.25\nviews:\n";

TEST(ViewSet, HasUnitsPathsAndAbsenceRight) {
  const test::TemporaryFolder folder;
  const ViewSet set = readViewSet(folder.write("views.yaml", kHead + R"(
  - {name: a, beads: beads/a.csv, primary_deg: 90, secondary_deg: -45, table_mm: [1, 2, -3],
     source_detector_distance_mm: 1200, held_out: true}
  - {name: b, image: b.png, machine: lab-1}
)"));
  EXPECT_EQ(set.machine, "lab-1");
  EXPECT_EQ(set.phantom_path, folder.path("helix.yaml"));
  EXPECT_EQ(set.image_width_px, 640);
  EXPECT_EQ(set.image_height_px, 480);
  EXPECT_DOUBLE_EQ(*set.pixel_spacing_m, 0.25e-3);
  ASSERT_EQ(set.views.size(), 2U);
  const PhantomView& a = set.views[0];
  EXPECT_EQ(a.path, folder.path("beads/a.csv"));
  EXPECT_TRUE(a.is_table && a.held_out);
  const CArmJoints expected = (CArmJoints() << kPi / 2, -kPi / 4, 1e-3, 2e-3, -3e-3).finished();
  EXPECT_LT((*a.joints - expected).norm(), 1e-15);
  EXPECT_DOUBLE_EQ(*a.source_detector_distance_m, 1.2);
  const PhantomView& b = set.views[1];
  EXPECT_FALSE(b.is_table || b.held_out || b.joints || b.source_detector_distance_m);
}

TEST(ViewSet, WrongOnesAreRefusedByLineAndField) {
  const test::TemporaryFolder folder;
  const auto refusal = [&](const std::string& content) {
    const std::string path = folder.write("views.yaml", content);
    return test::refusalOf([&] { readViewSet(path); });
  };
  const auto of = [&](const std::string& views) { return refusal(kHead + views); };
  EXPECT_NE(of("  - {name: a, image: a.png}\n  - {name: a, image: b.png}\n").find("views.yaml:7: views[1].name = a"),
            std::string::npos);
  EXPECT_NE(of("  - {name: a, image: a.png}\n  - {name: b, image: ./a.png}\n").find("is the file of views[0] already"),
            std::string::npos);
  EXPECT_NE(of("  - {name: a, image: a.png}\n  - {name: b, image: b.png, machine: lab-2}\n").find("lab-1"),
            std::string::npos);
  EXPECT_NE(of("  - {name: a, image: a.png, beads: a.csv}\n").find("either an image or a table"), std::string::npos);
  EXPECT_NE(of("  - {name: a, image: a.png, primary_deg: 4}\n").find("secondary_deg: is missing"), std::string::npos);
  EXPECT_NE(of("  - {name: a, image: a.png, primary_deg: 700, secondary_deg: 0}\n").find("primary_deg = 700"),
            std::string::npos);
  EXPECT_NE(of("  - {name: a, image: a.png, angle: 4}\n").find("unknown key"), std::string::npos);
  EXPECT_NE(refusal("phantom: p.yaml\nviews:\n  - {name: a, beads: a.csv}\n").find("image_size_px: is missing"),
            std::string::npos);
  EXPECT_NE(refusal("phantom: p.yaml\nviews: []\n").find("at least one view"), std::string::npos);
}

TEST(ViewSet, ACopyOfAViewIsRefused) {
  const test::TemporaryFolder folder;
  folder.write("a.csv", "x_px,y_px\n1,2\n");
  folder.write("b.csv", "x_px,y_px\n1,3\n");
  folder.write("c.csv", "x_px,y_px\n1,2\n");
  const ViewSet set = readViewSet(folder.write(
      "views.yaml", kHead + "  - {name: a, beads: a.csv}\n  - {name: b, beads: b.csv}\n  - {name: c, beads: c.csv}\n"));
  EXPECT_NE(test::refusalOf([&] { hashedViews(set); }).find("views = c: is a copy of a"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

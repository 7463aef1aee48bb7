// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/bead_phantom.hpp"
#include "angio/test/namespace.hpp"

#include <gtest/gtest.h>

#include <set>

#include "angio/base/formatted.hpp"
#include "angio/geometry/se3.hpp"
#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "bead_scenes.hpp"

namespace angio::test {
namespace {

class BeadPhantomFile : public testing::Test {
 protected:
  std::string refusal(const BeadPhantom& phantom, double unit = 1e3) {
    std::string text = "name: wrong\nbeads:\n";
    for (const Bead& bead : phantom.beads) {
      text += formatted("  - [%.9g, %.9g, %.9g, %.9g]\n", unit * bead.position_m.x(), unit * bead.position_m.y(),
                        unit * bead.position_m.z(), 2e3 * bead.radius_m);
    }
    const std::string path = folder_.write("phantom.yaml", text);
    return test::refusalOf([&] { readBeadPhantom(path); });
  }

  test::TemporaryFolder folder_;
};

TEST_F(BeadPhantomFile, OwnPhantomsComeBack) {
  for (const BeadPhantom& phantom : {helixPhantom(), platePhantom(), helixPhantom({20, 60, 2, 40, 1, 2})}) {
    const std::string path = folder_.path("phantom.yaml");
    writeBeadPhantom(path, phantom);
    const BeadPhantom back = readBeadPhantom(path);
    EXPECT_EQ(back.name, phantom.name);
    ASSERT_EQ(back.beads.size(), phantom.beads.size());
    EXPECT_LT((back.positions_m() - phantom.positions_m()).norm(), 1e-15);
    EXPECT_TRUE(back.isCoded());
    EXPECT_FALSE(back.isPlanar());
  }
}

TEST(HelixPhantom, EveryRunOfEightOccursOnceInNeitherDirectionTwice) {
  for (const int beads : {30, 108}) {
    HelixPhantomSettings settings;
    settings.beads = beads;
    const BeadPhantom phantom = helixPhantom(settings);
    ASSERT_EQ(static_cast<int>(phantom.beads.size()), beads);
    std::set<std::string> runs;
    for (int i = 0; i + 8 <= beads; ++i) {
      std::string run;
      for (int k = 0; k < 8; ++k) run += phantom.beads[static_cast<std::size_t>(i + k)].radius_m > 1e-3 ? 'L' : 's';
      const std::string reversed(run.rbegin(), run.rend());
      EXPECT_TRUE(runs.insert(run).second && (reversed == run || runs.insert(reversed).second)) << i;
      EXPECT_NE(run, reversed) << i;
    }
  }
}

TEST_F(BeadPhantomFile, WrongUnitsAreRefused) {
  EXPECT_NE(refusal(helixPhantom(), 1).find("are these metres?"), std::string::npos);
  EXPECT_NE(refusal(helixPhantom(), 1e6).find("beads[0]"), std::string::npos);
}

TEST_F(BeadPhantomFile, ArrangementsThatNoViewTellsApartAreRefused) {
  BeadPhantom plain = helixPhantom();
  for (Bead& bead : plain.beads) bead.radius_m = 1e-3;  // A helix without its code turns end over end onto itself.
  EXPECT_NE(refusal(plain).find("turned, bead"), std::string::npos);

  BeadPhantom mirrored = helixPhantom({45, 130, 1.3, 12, 1.6, 3.2});
  const std::size_t half = mirrored.beads.size();
  for (std::size_t i = 0; i < half; ++i) {
    Bead other = mirrored.beads[i];
    other.position_m.x() = 0.12 - other.position_m.x();
    mirrored.beads.push_back(other);
  }
  EXPECT_NE(refusal(mirrored).find("mirrored, bead"), std::string::npos);

  BeadPhantom flat = helixPhantom();
  for (std::size_t i = 0; i < flat.beads.size(); ++i) flat.beads[i].position_m.z() = 0.005 * static_cast<double>(i);
  for (Bead& bead : flat.beads) bead.position_m.x() = 0;
  EXPECT_NE(refusal(flat).find("one plane"), std::string::npos);
}

TEST_F(BeadPhantomFile, BeadsThatCannotBeAreRefused) {
  BeadPhantom touching = helixPhantom();
  touching.beads[5].position_m = touching.beads[2].position_m + Eigen::Vector3d(1e-3, 0, 0);
  EXPECT_NE(refusal(touching).find("must not touch bead 2"), std::string::npos);
  BeadPhantom few = helixPhantom();
  few.beads.resize(7);
  EXPECT_NE(refusal(few).find("8 to"), std::string::npos);
  BeadPhantom thick = helixPhantom();
  thick.beads[3].radius_m = 1;
  EXPECT_NE(refusal(thick).find("beads[3] diameter_mm = 2000"), std::string::npos);
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include <gtest/gtest.h>

#include <algorithm>

#include "angio/test/errors.hpp"
#include "angio/test/temporary_folder.hpp"
#include "bead_symmetry.hpp"
#include "cube_scenes.hpp"

namespace angio::test {
namespace {

std::string refusedReading(const BeadPhantom& phantom, const UncodedScene& scene, const ReadingHint& hint) {
  return test::refusalOf(
      [&] { chosenReading("cube.png", phantom, readingsOf("cube.png", phantom, scene.view), scene.view, hint); });
}

bool contains(const std::string& line, const char* words) { return line.find(words) != std::string::npos; }

TEST(PhantomSymmetry, ACubeHas24TurnsAndAsManyMirrorings) {
  const auto all = symmetriesOf(cubePhantom(), 1e-3);
  EXPECT_EQ(all.size(), 48u);
  EXPECT_EQ(std::count_if(all.begin(), all.end(), [](const PhantomSymmetry& s) { return s.mirrors; }), 24);
  BeadPhantom marked = cubePhantom();
  marked.beads[5].position_m.x() += 5e-3;
  EXPECT_EQ(symmetriesOf(marked, 1e-3).size(), 1u);
}

// One cube, everything that may be wrong with it.
TEST(UncodedBeads, NamedBeadsLeaveTheTrueReadingOfACube) {
  test::Random random(1);
  const BeadPhantom cube = cubePhantom();
  const UncodedScene scene = uncodedScene(cube, cubeCamera(), cubeView(), 0.4, 3, random);
  const auto readings = readingsOf("cube.png", cube, scene.view);
  EXPECT_EQ(std::count_if(readings.begin(), readings.end(), [](const PhantomReading& r) { return !r.mirrored; }) % 24,
            0);
  const std::vector<std::size_t> which = {0, 5, 11, 17};
  const PhantomReading reading = chosenReading("cube.png", cube, readings, scene.view, scene.named(which));
  int named = 0, seen = 0;
  for (std::size_t d = 0; d < scene.truth.size(); ++d) {
    seen += scene.truth[d].has_value();
    named += reading.bead[d].has_value();
    if (reading.bead[d]) {
      EXPECT_EQ(reading.bead[d], scene.truth[d]) << d;
    }
  }
  EXPECT_EQ(named, seen);
  EXPECT_LT(rotationAngle(reading.T_camera_phantom.linear().transpose() * cubeView().linear()), degToRad(1.5));

  ReadingHint near;
  near.T_near = cubeView();
  near.T_near->linear() = expSO3({0.1, 0, 0.1}) * cubeView().linear();
  EXPECT_EQ(chosenReading("cube.png", cube, readings, scene.view, near).bead, reading.bead);

  // Nothing known: many readings. Rows in another order; the file mirrored; names of a wrong place.
  EXPECT_TRUE(contains(refusedReading(cube, scene, {}), "fit equally well"));
  BeadPhantom shuffled = cube, mirrored = cube;
  std::swap(shuffled.beads[static_cast<std::size_t>(*scene.truth[0])],
            shuffled.beads[static_cast<std::size_t>(*scene.truth[7])]);
  EXPECT_TRUE(contains(refusedReading(shuffled, scene, scene.named(which)), "another order"));
  for (Bead& bead : mirrored.beads) bead.position_m.x() *= -1;
  EXPECT_TRUE(contains(refusedReading(mirrored, scene, scene.named(which)), "mirrored"));
  ReadingHint nowhere = scene.named({0});
  nowhere.named[0].first += Eigen::Vector2d(60, 0);
  EXPECT_TRUE(contains(refusedReading(cube, scene, nowhere), "no bead was found"));
  // In millimetres what was said to be centimetres.
  EXPECT_TRUE(contains(refusedReading(cubePhantom(0.0065), scene, {}), "unit or scale"));
}

// Beads without any order have one reading, and a mirrored picture of them none.
TEST(UncodedBeads, AnUnevenPhantomNeedsNoHint) {
  test::Random random(2);
  BeadPhantom phantom;
  phantom.name = "uneven";
  for (int i = 0; i < 18; ++i) {
    const double z = random.uniform(0, 0.15), y = random.uniform(0, 0.15), x = random.uniform(0, 0.15);
    phantom.beads.push_back({{x, y, z}, 0});
  }
  const Pose T = phantomView(phantom, expSO3({0.5, -1, 2}), {0.01, -0.01, 0.85});
  UncodedScene scene = uncodedScene(phantom, cubeCamera(), T, 0.4, 2, random);
  const auto readings = readingsOf("p.png", phantom, scene.view);
  ASSERT_EQ(readings.size(), 1u);
  for (std::size_t d = 0; d < scene.truth.size(); ++d) EXPECT_EQ(readings[0].bead[d], scene.truth[d]) << d;
  scene.view.pinhole_px.row(0) = (1023 - scene.view.pinhole_px.row(0).array()).matrix();
  EXPECT_TRUE(contains(test::refusalOf([&] { readingsOf("p.png", phantom, scene.view); }), "mirrored"));
  for (Bead& bead : phantom.beads)
    bead.position_m =
        Eigen::Vector3d(bead.position_m.y(), bead.position_m.x() + bead.position_m.z(), 0.3 * bead.position_m.z());
  EXPECT_TRUE(contains(test::refusalOf([&] { readingsOf("p.png", phantom, scene.view); }), "two thirds"));
}

TEST(PointPhantom, UnitsAndWrongRowsAreRefusedByLine) {
  const test::TemporaryFolder folder;
  std::string rows;  // Of a cube of 2.
  const auto side = [](int bit) { return std::to_string(2 * (bit & 1)); };
  for (int i = 0; i < 8; ++i) rows += side(i) + "," + side(i >> 1) + "," + side(i >> 2) + "\n";
  const std::string path = folder.write("f.csv", "x,y,z\n" + rows);
  EXPECT_LT((readPointPhantom(path, 0.01).beads[7].position_m - Eigen::Vector3d::Constant(0.02)).norm(), 1e-15);
  EXPECT_TRUE(contains(test::refusalOf([&] { readPointPhantom(path, {}); }), "--phantom-unit"));
  EXPECT_TRUE(contains(test::refusalOf([&] { readPointPhantom(path, 1e-3); }), "10 mm"));
  const std::string twice = folder.write("t.csv", "x_mm,y_mm,z_mm\n10,10,10\n10,10,10\n");
  EXPECT_TRUE(contains(test::refusalOf([&] { readPointPhantom(twice, {}); }), "t.csv:3"));
}

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
// Every named convention gives back what it was given, through its file.
#include <gmock/gmock.h>

#include "angio/conventions/euler_zxy.hpp"
#include "angio/conventions/projection_files.hpp"
#include "angio/test/temporary_folder.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

std::vector<std::string> variantNames() {
  std::vector<std::string> names;
  for (const ConventionName& one : conventionNames()) names.push_back(one.name);
  return names;
}

struct RoundTrip : testing::TestWithParam<std::string> {
  TemporaryFolder folder;

  XrayProjection there(const XrayProjection& ours, const WorldFrame& world) {
    const std::string file = folder.write("theirs.yaml", describeProjection(GetParam(), ours, world));
    return readProjection({file, "", 0, {}}).projection;
  }
};

TEST_P(RoundTrip, GivesBackPoseAndCamera) {
  Random random(7);
  for (int trial = 0; trial < 50; ++trial) {
    const XrayProjection ours = randomProjection(random);
    WorldFrame world;
    world.model_axes = std::array{ModelAxes::kLps, ModelAxes::kRas, ModelAxes::kWorld}[trial % 3];
    world.isocenter_mm = random.vector(5);
    expectSame(there(ours, world), ours);
  }
}

// Where angles stop to be unique: views along the axes, and the turns between.
TEST_P(RoundTrip, GivesBackViewsAtWhichAnglesAreNotUnique) {
  Random random(8);
  XrayProjection ours = randomProjection(random);
  for (int x = -1; x <= 2; ++x) {
    for (int y = -1; y <= 2; ++y) {
      for (int z = -1; z <= 2; ++z) {
        // Half a turn from the identity is where a rotation vector has two values, of which either is right.
        ours.T_camera_model.linear() = rotationZxy(0.5 * kPi * Eigen::Vector3d(x, y, z));
        // A positive distance along the beam, which RTK asks of the isocentre.
        ours.T_camera_model.translation() = Eigen::Vector3d(0.01, 0.02, 0.75);
        expectSame(there(ours, {}), ours);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Conventions, RoundTrip, testing::ValuesIn(variantNames()), [](const auto& one) {
  std::string name = one.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace angio::test

// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/visp_pose.hpp"

#include "angio/geometry/visp.hpp"
#include "projections.hpp"

namespace angio::test {
namespace {

// By hand: a quarter turn about z takes the model's x to the picture's down. ViSP's own classes say the same.
TEST(VispPose, AQuarterTurnByHandAndByVisp) {
  VispProjection p;
  p.t_mm = {10, -20, 750};
  p.thetau_deg = {0, 0, 90};
  p.px = p.py = 4000;
  p.u0 = 511.5;
  p.v0 = 500;
  p.detector.width_px = p.detector.height_px = 1024;
  const Pose cMo = fromVispPose(p).T_camera_model;
  EXPECT_LT((cMo * Eigen::Vector3d(1e-3, 0, 0) - Eigen::Vector3d(10e-3, -19e-3, 0.75)).norm(), 1e-12);
  const vpHomogeneousMatrix by_visp(10e-3, -20e-3, 0.75, 0, 0, 0.5 * kPi);
  EXPECT_LT((fromVisp(by_visp).matrix() - cMo.matrix()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(VispPose, VispBuildsTheSamePoseFromWhatIsWritten) {
  Random random(11);
  for (int trial = 0; trial < 20; ++trial) {
    const XrayProjection ours = randomProjection(random);
    const VispProjection p = toVispPose(ours);
    const Eigen::Vector3d t = 1e-3 * p.t_mm, w = degToRad(1) * p.thetau_deg;
    const vpHomogeneousMatrix cMo(t.x(), t.y(), t.z(), w.x(), w.y(), w.z());
    EXPECT_LT((fromVisp(cMo).matrix() - ours.T_camera_model.matrix()).cwiseAbs().maxCoeff(), 1e-9);
  }
}

}  // namespace
}  // namespace angio::test

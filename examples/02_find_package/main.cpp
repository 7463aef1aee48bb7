// SPDX-License-Identifier: GPL-2.0-or-later
// How do I use angio from a project of my own? Here: one command of the servo law, for a C-arm 30 deg from its goal.
#include <cstdio>

#include "angio/geometry/visp.hpp"
#include "angio/servo/desired_view.hpp"
#include "angio/servo/servo_law.hpp"

int main() {
  const angio::CArmGeometry carm;
  const angio::CArmJoints joints = angio::CArmJoints::Zero();
  const angio::DesiredView view{{angio::degToRad(30), 0}, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()};
  const auto law = angio::makeServoLaw(angio::PositionBasedSettings{});
  const auto velocity = law->velocity({angio::toVisp(carm.T_camera_patient(joints)),
                                       angio::toVisp(angio::desiredPose(view, carm.source_isocentre_distance_m)),
                                       angio::toVisp(carm.eJe(joints))});
  if (!velocity) return 1;
  std::printf("primary %.3f deg/s, secondary %.3f deg/s\n", angio::radToDeg((*velocity)[0]),
              angio::radToDeg((*velocity)[1]));
  return (*velocity)[0] > 0 ? 0 : 1;  // Towards LAO.
}

// SPDX-License-Identifier: GPL-2.0-or-later
// How do I use angio from a project of my own? Here: one command of the servo law, for a C-arm 30 deg from its goal.
#include <cstdio>

#include "angio/geometry/visp.hpp"
#include "angio/servo/desired_view.hpp"
#include "angio/servo/servo_law.hpp"

int main() {
  const angio::geometry::CArmGeometry carm;
  const angio::geometry::CArmJoints joints = angio::geometry::CArmJoints::Zero();
  const angio::servo::DesiredView view{
      {angio::geometry::degToRad(30), 0}, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()};
  const auto law = angio::servo::makeServoLaw(angio::servo::PositionBasedSettings{});
  const auto velocity =
      law->velocity({angio::geometry::toVisp(carm.T_camera_patient(joints)),
                     angio::geometry::toVisp(angio::servo::desiredPose(view, carm.source_isocenter_distance_m)),
                     angio::geometry::toVisp(carm.eJe(joints))});
  if (!velocity) return 1;
  std::printf("primary %.3f deg/s, secondary %.3f deg/s\n", angio::geometry::radToDeg((*velocity)[0]),
              angio::geometry::radToDeg((*velocity)[1]));
  return (*velocity)[0] > 0 ? 0 : 1;  // Towards LAO.
}

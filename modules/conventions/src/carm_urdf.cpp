// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/conventions/carm_urdf.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "angio/base/formatted.hpp"
#include "angio/io/text.hpp"

namespace angio::conventions {
namespace {

std::string numbersOf(const Eigen::Vector3d& v) { return exact(v.x()) + " " + exact(v.y()) + " " + exact(v.z()); }

// URDF's fixed angles: R = Rz(yaw) Ry(pitch) Rx(roll). Not for a pitch of 90 deg, which no mount of a C-arm has.
Eigen::Vector3d rollPitchYaw(const Eigen::Matrix3d& R) {
  return {std::atan2(R(2, 1), R(2, 2)), std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0))),
          std::atan2(R(1, 0), R(0, 0))};
}

// A joint with its child's link. The rest stands between its tags.
std::string joint(const std::string& name, const char* type, const char* parent, const std::string& child,
                  const Eigen::Vector3d& xyz, const Eigen::Vector3d& rpy, const std::string& rest = "") {
  return "  <joint name=\"" + name + "\" type=\"" + type + "\">\n    <parent link=\"" + parent +
         "\"/>\n    <child link=\"" + child + "\"/>\n    <origin xyz=\"" + numbersOf(xyz) + "\" rpy=\"" +
         numbersOf(rpy) + "\"/>\n" + rest + "  </joint>\n  <link name=\"" + child + "\"/>\n";
}

// Effort is asked for by URDF and known of no C-arm.
std::string motion(const Eigen::Vector3d& axis, int index, const CArmLimits& limits, double scale) {
  return "    <axis xyz=\"" + numbersOf(axis) + "\"/>\n    <limit lower=\"" + exact(scale * limits.lower[index]) +
         "\" upper=\"" + exact(scale * limits.upper[index]) + "\" velocity=\"" + exact(scale * limits.velocity[index]) +
         "\" effort=\"0\"/>\n";
}

std::string armOf(const CArmGeometry& carm, const CArmLimits& limits) {
  const CArmDeviations& d = carm.deviations;
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  // The mount, as CArmGeometry has it: the camera's turns, and where the source is from the secondary axis.
  const Eigen::Matrix3d R_camera_ideal = (Eigen::AngleAxisd(-d.detector_roll_rad, Eigen::Vector3d::UnitZ()) *
                                          Eigen::AngleAxisd(-d.detector_turn_rad, Eigen::Vector3d::UnitY()))
                                             .toRotationMatrix();
  Pose T_camera_arm = Pose::Identity();
  T_camera_arm.linear() = R_camera_ideal * viewRotation(ViewAngles{});
  T_camera_arm.translation() =
      R_camera_ideal * Eigen::Vector3d(-d.source_right_m, -d.source_down_m, carm.source_isocenter_distance_m);
  const Pose T_arm_camera = T_camera_arm.inverse();
  return joint("l_arm", "fixed", "isocentre", "l_arm_base", zero, {0, carm.l_arm_rad, 0}) +
         joint("primary", "revolute", "l_arm_base", "gantry", zero, {0, 0, d.primary_offset_rad},
               motion(Eigen::Vector3d::UnitZ(), 0, limits, 1)) +
         joint("secondary", "revolute", "gantry", "arm", {0, d.axis_gap_m, 0},
               {-d.secondary_offset_rad, d.axis_skew_rad, 0}, motion(-Eigen::Vector3d::UnitX(), 1, limits, 1)) +
         joint("mount", "fixed", "arm", "camera", T_arm_camera.translation(), rollPitchYaw(T_arm_camera.linear())) +
         joint("beam", "fixed", "camera", "detector",
               {0, 0, carm.source_detector_distance_m + d.source_detector_offset_m}, zero);
}

std::string tableOf(const CArmGeometry& carm, const CArmLimits& limits) {
  const char* const names[3] = {"table_x", "table_y", "table_z"};
  std::string text, transmissions;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d column = carm.deviations.table.col(k);
    const double scale = column.norm();
    const char* const parent = k == 0 ? "isocentre" : k == 1 ? "table_x_stage" : "table_y_stage";
    const std::string child = k == 2 ? "patient" : std::string(names[k]) + "_stage";
    text += joint(names[k], "prismatic", parent, child, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                  motion(column / scale, k + 2, limits, scale));
    if (scale == 1) continue;
    const std::string encoder = std::string(names[k]) + "_encoder";
    transmissions += "  <transmission name=\"" + encoder + "\">\n    <type>transmission_interface/SimpleTransmission" +
                     "</type>\n    <joint name=\"" + names[k] + "\"/>\n    <actuator name=\"" + encoder +
                     "\">\n      <mechanicalReduction>" + exact(1 / scale) +
                     "</mechanicalReduction>\n    </actuator>\n  </transmission>\n";
  }
  return text + transmissions;
}

// A name is XML's text and a robot's name.
std::string plainName(const std::string& name) {
  std::string plain = name.empty() ? "carm" : name;
  std::replace_if(
      plain.begin(), plain.end(), [](unsigned char c) { return !std::isalnum(c) && c != '-' && c != '_'; }, '_');
  return plain;
}

// On a grid of the angles: the bends are smooth waves of at most eight to a turn.
void measureFlex(const CArmFlex& flex, const CArmLimits& limits, CArmUrdf& urdf) {
  constexpr int kSteps = 48;
  for (int i = 0; i <= kSteps && flex.count > 0; ++i) {
    for (int k = 0; k <= kSteps; ++k) {
      const double a = limits.lower[0] + (limits.upper[0] - limits.lower[0]) * i / kSteps;
      const double b = limits.lower[1] + (limits.upper[1] - limits.lower[1]) * k / kSteps;
      const Twist bend = flex.at(a, b);
      urdf.left_out_mm = std::max(urdf.left_out_mm, 1e3 * bend.head<3>().norm());
      urdf.left_out_deg = std::max(urdf.left_out_deg, radToDeg(bend.tail<3>().norm()));
    }
  }
}

}  // namespace

CArmUrdf carmAsUrdf(const CArmGeometry& carm, const CArmLimits& limits, const std::string& name) {
  CArmUrdf urdf;
  measureFlex(carm.deviations.flex, limits, urdf);
  urdf.text = "<?xml version=\"1.0\"?>\n<robot name=\"" + plainName(name) + "\">\n";
  if (carm.deviations.flex.count > 0) {
    urdf.text += formatted("  <!-- Without the arm's bending: up to %.2f mm and %.3f deg of the camera. -->\n",
                           urdf.left_out_mm, urdf.left_out_deg);
  }
  urdf.text += "  <link name=\"isocentre\"/>\n" + armOf(carm, limits) + tableOf(carm, limits) + "</robot>\n";
  return urdf;
}

}  // namespace angio::conventions

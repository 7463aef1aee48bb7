// SPDX-License-Identifier: GPL-2.0-or-later
// The robot description moves as the C-arm does: forward kinematics of the file against ours.
#include "angio/conventions/carm_urdf.hpp"

#include <gmock/gmock.h>

#include <map>

#include "angio/io/text.hpp"
#include "angio/io/xml.hpp"
#include "angio/test/namespace.hpp"
#include "angio/test/random.hpp"

namespace angio::test {
namespace {

using testing::HasSubstr;
using testing::Not;

// Forward kinematics by URDF's rules: origin, then a turn about the axis or a move along it.
class UrdfRobot {
 public:
  explicit UrdfRobot(const std::string& text) : document_("carm.urdf", text) {}

  Pose T_root_link(const std::string& link, const std::map<std::string, double>& positions) const {
    for (const XmlElement* joint : document_.root().childrenOf("joint")) {
      if (document_.need(*joint->child("child"), "link") != link) continue;
      const Eigen::Vector3d rpy = vector(*joint, "origin", "rpy");
      Pose T = Pose::Identity();
      T.linear() =
          (Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX()))
              .toRotationMatrix();
      T.translation() = vector(*joint, "origin", "xyz");
      const std::string name = document_.need(*joint, "name"), type = document_.need(*joint, "type");
      if (type == "revolute") T = T * Eigen::AngleAxisd(positions.at(name), vector(*joint, "axis", "xyz"));
      if (type == "prismatic") T = T * Eigen::Translation3d(positions.at(name) * vector(*joint, "axis", "xyz"));
      return T_root_link(document_.need(*joint->child("parent"), "link"), positions) * T;
    }
    return Pose::Identity();
  }

  Eigen::Vector3d axis(const std::string& name) const { return vector(jointNamed(name), "axis", "xyz"); }

  // What the joint moves by for one of its encoder's metres.
  double scale(const std::string& name) const {
    for (const XmlElement* transmission : document_.root().childrenOf("transmission")) {
      if (document_.need(*transmission->child("joint"), "name") != name) continue;
      const XmlElement& reduction = *transmission->child("actuator")->child("mechanicalReduction");
      return 1 / parseNumber("carm.urdf", "mechanicalReduction", document_.textOf(reduction));
    }
    return 1;
  }

 private:
  const XmlElement& jointNamed(const std::string& name) const {
    for (const XmlElement* joint : document_.root().childrenOf("joint")) {
      if (document_.need(*joint, "name") == name) return *joint;
    }
    throw std::runtime_error("no joint " + name);
  }
  Eigen::Vector3d vector(const XmlElement& joint, const char* element, const char* attribute) const {
    const std::string text = document_.need(*joint.child(element), attribute);
    std::vector<std::string_view> words;
    splitAtBlanks(text, words);
    Eigen::Vector3d v;
    for (int k = 0; k < 3; ++k) v[k] = parseNumber("carm.urdf", attribute, words.at(k));
    return v;
  }

  XmlDocument document_;
};

CArmGeometry crookedArm(Random& random) {
  CArmGeometry carm;
  auto values = carm.poseParameters();
  for (int k = 0; k < kCArmPoseParameters; ++k)
    values[k] += 2 * kCArmPoseParameterNames[k].unit * random.normal() * (k < kFirstTableParameter ? 1 : 0.01);
  carm.setPoseParameters(values);
  carm.l_arm_rad = random.uniform(-kPi, kPi);
  carm.deviations.source_detector_offset_m = 3e-3;
  return carm;
}

void expectSameMotion(const CArmGeometry& carm, Random& random) {
  const UrdfRobot robot(carmAsUrdf(carm, CArmLimits::typical()).text);
  for (int trial = 0; trial < 50; ++trial) {
    CArmJoints joints;
    joints << random.vector(1).head<2>(), random.vector(0.1);
    std::map<std::string, double> positions = {{"primary", joints[0]}, {"secondary", joints[1]}};
    for (int k = 0; k < 3; ++k) {
      const std::string name = std::string("table_") + "xyz"[k];
      EXPECT_NEAR(robot.axis(name).norm(), 1, 1e-12);
      positions[name] = robot.scale(name) * joints[2 + k];
    }
    const Pose T_camera_patient =
        robot.T_root_link("camera", positions).inverse() * robot.T_root_link("patient", positions);
    EXPECT_LT((T_camera_patient.matrix() - carm.T_camera_patient(joints).matrix()).cwiseAbs().maxCoeff(), 1e-9);
    const Pose T_camera_detector =
        robot.T_root_link("camera", positions).inverse() * robot.T_root_link("detector", positions);
    const double distance_m = *carm.camera().parameters().source_detector_distance_m;
    EXPECT_LT((T_camera_detector.translation() - Eigen::Vector3d(0, 0, distance_m)).norm(), 1e-9);
  }
}

TEST(CArmUrdf, AnIdealArmMovesAsOurs) {
  Random random(1);
  const CArmGeometry carm;
  EXPECT_THAT(carmAsUrdf(carm, CArmLimits::typical()).text, Not(HasSubstr("transmission")));
  expectSameMotion(carm, random);
}

TEST(CArmUrdf, ACalibratedArmMovesAsOurs) {
  Random random(2);
  for (int arm = 0; arm < 10; ++arm) expectSameMotion(crookedArm(random), random);
}

// A URDF is rigid between its joints: what the bending would add is said.
TEST(CArmUrdf, WhatItCannotSayIsMeasured) {
  CArmGeometry carm;
  carm.deviations.flex.count = 1;
  // sin(a) of 2 mm and 0.1 deg, a up to 120 deg: the most at 90 deg.
  carm.deviations.flex.terms[0].twist << 2e-3, 0, 0, 0, degToRad(0.1), 0;
  carm.deviations.flex.terms[0].frequency_primary = 1;
  const CArmUrdf urdf = carmAsUrdf(carm, CArmLimits::typical(), "lab 1 <x>");
  EXPECT_NEAR(urdf.left_out_mm, 2, 1e-9);
  EXPECT_NEAR(urdf.left_out_deg, 0.1, 1e-9);
  EXPECT_THAT(urdf.text, HasSubstr("up to 2.00 mm and 0.100 deg"));
  EXPECT_THAT(urdf.text, HasSubstr("<robot name=\"lab_1__x_\">"));
}

}  // namespace
}  // namespace angio::test

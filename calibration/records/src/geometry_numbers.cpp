// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/geometry_numbers.hpp"

#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"

namespace angio::calibration_records {
namespace {

constexpr CArmParameter kCamera[kCameraNumbers] = {{"source_detector_offset_mm", 1e-3},
                                                   {"pixel_aspect", 1},
                                                   {"principal_point_x_px", 1},
                                                   {"principal_point_y_px", 1},
                                                   {"principal_point_slope_x_px_per_mm", 1e3},
                                                   {"principal_point_slope_y_px_per_mm", 1e3}};

}  // namespace

GeometryNumber geometryNumber(int place) {
  if (place < kFirstFlexNumber) {
    const CArmParameter& parameter = place < kFirstCameraNumber ? kCArmPoseParameterNames[place - kFirstArmNumber]
                                                                : kCamera[place - kFirstCameraNumber];
    return {parameter.name, parameter.unit};
  }
  static const char* kTwist[6] = {"vx_mm", "vy_mm", "vz_mm", "wx_deg", "wy_deg", "wz_deg"};
  const int term = (place - kFirstFlexNumber) / 6, k = (place - kFirstFlexNumber) % 6;
  return {formatted("flex_%d_%s", term + 1, kTwist[k]), k < 3 ? 1e-3 : degToRad(1)};
}

std::optional<int> placeOfGeometryNumber(const std::string& name) {
  for (int place = kFirstArmNumber; place < kModelNumbers; ++place) {
    if (geometryNumber(place).name == name) return place;
  }
  return std::nullopt;
}

Eigen::Matrix<double, 6, kModelNumbers> cameraByNumbers(const CArmGeometry& carm, const CArmJoints& joints) {
  Eigen::Matrix<double, 6, kModelNumbers> J = Eigen::Matrix<double, 6, kModelNumbers>::Zero();
  CArmPoseJacobian by_arm;
  carm.T_camera_patient(joints, &by_arm);
  J.block<6, kCArmPoseParameters>(0, kFirstArmNumber) = by_arm;
  const CArmFlex& flex = carm.deviations.flex;
  if (flex.count == 0) return J;
  const double a = joints[0], b = joints[1];
  const Matrix6d by_twist = inverseOf(rightJacobianInverseSE3(flex.at(a, b)));
  for (int i = 0; i < flex.count; ++i) {
    J.block<6, 6>(0, kFirstFlexNumber + 6 * i) = by_twist * flex.terms[i].wave(a, b);
  }
  return J;
}

}  // namespace angio::calibration_records

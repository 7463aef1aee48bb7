// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "angio/calibration_records/namespace.hpp"
#include "angio/geometry/carm.hpp"

namespace angio::calibration_records {

/// All numbers of a C-arm's geometry and of where a phantom lies, in one order: the phantom's place (a change from the
/// right, [m, rad]), the arm's (kCArmPoseParameterNames), the camera's (source-detector offset [m], pixel aspect,
/// principal point [px], its slope [px/m]), the flex terms' twists.
constexpr int kPhantomNumbers = 6;
constexpr int kCameraNumbers = 6;
constexpr int kFirstArmNumber = kPhantomNumbers;
constexpr int kFirstCameraNumber = kFirstArmNumber + kCArmPoseParameters;
constexpr int kFirstFlexNumber = kFirstCameraNumber + kCameraNumbers;
constexpr int kFlexNumbers = 6 * CArmFlex::kMaxTerms;
constexpr int kModelNumbers = kFirstFlexNumber + kFlexNumbers;

/// What one of the numbers is called in a record, and how large a unit of it is in SI.
struct GeometryNumber {
  std::string name;
  double unit;
};
GeometryNumber geometryNumber(int place);

/// Where the number of that name stands, if it is one.
std::optional<int> placeOfGeometryNumber(const std::string& name);

/// Derivatives by all numbers: twists of the camera relative to the patient, in the camera frame, as CArmPoseJacobian.
Eigen::Matrix<double, 6, kModelNumbers> cameraByNumbers(const CArmGeometry& carm, const CArmJoints& joints);

}  // namespace angio::calibration_records

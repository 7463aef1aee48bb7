// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/transform_numbers.hpp"

namespace angio::calibration_records {

std::vector<std::string> transformNumberNames(const std::string& transform) {
  std::vector<std::string> names;
  for (const char* number : {"x_mm", "y_mm", "z_mm", "turn_x_deg", "turn_y_deg", "turn_z_deg"}) {
    names.push_back(transform + "_" + number);
  }
  return names;
}

Vector6d transformNumberUnits() {
  Vector6d units;
  units << Eigen::Vector3d::Constant(1e-3), Eigen::Vector3d::Constant(degToRad(1));
  return units;
}

}  // namespace angio::calibration_records

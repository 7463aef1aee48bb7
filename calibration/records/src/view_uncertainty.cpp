// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration_records/view_uncertainty.hpp"

#include <cmath>
#include <string>
#include <vector>

#include "angio/calibration_records/geometry_numbers.hpp"
#include "angio/calibration_records/transform_numbers.hpp"

namespace angio::calibration_records {
namespace {

const CalibrationRecord* recordOf(const CArmCalibration& calibration, const std::string& kind) {
  for (const auto& record : calibration.records) {
    if (record.kind == kind) return &record;
  }
  return nullptr;
}

// Covariance of a twist of the model in its parent [m, rad], from the right: of T_dsa_cb's place and turns about the
// patient's axes.
std::optional<Matrix6d> modelCovariance(const CArmCalibration& calibration) {
  for (const char* kind : {"registration", "hand_eye"}) {
    const CalibrationRecord* record = recordOf(calibration, kind);
    if (!record) continue;
    for (const char* name : {"T_dsa_cb", "T_base_object"}) {
      std::vector<int> places;
      for (const std::string& number : transformNumberNames(name)) {
        if (const auto at = record->placeOf(number)) places.push_back(static_cast<int>(*at));
      }
      if (places.size() != 6) continue;
      const Vector6d units = transformNumberUnits();
      return Matrix6d(units.asDiagonal() * record->covariance(places, places) * units.asDiagonal());
    }
  }
  return std::nullopt;
}

// Of the camera's twist by the geometry's numbers, about the source.
Matrix6d cameraCovariance(const CArmCalibration& calibration, const CalibrationRecord& record,
                          const CArmJoints& joints) {
  std::vector<int> numbers, places;
  std::vector<double> units;
  for (std::size_t i = 0; i < record.parameters.size(); ++i) {
    const auto number = placeOfGeometryNumber(record.parameters[i]);
    if (!number) continue;
    numbers.push_back(*number);
    units.push_back(geometryNumber(*number).unit);
    places.push_back(static_cast<int>(i));
  }
  const auto J = cameraByNumbers(calibration.carm, joints);
  const Eigen::Map<const Eigen::VectorXd> unit(units.data(), static_cast<Eigen::Index>(units.size()));
  const Eigen::MatrixXd by_file = J(Eigen::all, numbers) * unit.asDiagonal();
  return by_file * record.covariance(places, places) * by_file.transpose();
}

double valueOf(const CalibrationRecord& record, const std::string& name) {
  const auto at = record.placeOf(name);
  return at ? record.values[*at] : 0;
}

}  // namespace

std::optional<ViewUncertainty> viewUncertainty(const CArmCalibration& calibration, const CArmJoints& joints,
                                               const Eigen::Vector3d& target_model) {
  const auto of_model = modelCovariance(calibration);
  if (!of_model) return std::nullopt;
  const Pose T_camera_patient = calibration.carm.T_camera_patient(joints);
  const Eigen::Vector3d target_patient = calibration.T_dsa_cb * target_model,
                        target = T_camera_patient * target_patient;
  const Eigen::Matrix3d& R = T_camera_patient.linear();
  // A place and a turn of the model about its own origin, in the camera.
  Eigen::Matrix<double, 3, 6> target_by_model, turn_by_model = Eigen::Matrix<double, 3, 6>::Zero();
  target_by_model << R, -R * skew(target_patient - calibration.T_dsa_cb.translation());
  turn_by_model.rightCols<3>() = R;
  Eigen::Matrix3d target_variance = target_by_model * *of_model * target_by_model.transpose(),
                  turn_variance = turn_by_model * *of_model * turn_by_model.transpose();
  if (const CalibrationRecord* geometry = recordOf(calibration, "geometry")) {
    const Matrix6d of_camera = cameraCovariance(calibration, *geometry, joints);
    Eigen::Matrix<double, 3, 6> target_by_camera;
    target_by_camera << -Eigen::Matrix3d::Identity(), skew(target);
    target_variance += target_by_camera * of_camera * target_by_camera.transpose();
    turn_variance += of_camera.bottomRightCorner<3, 3>();
    const double scatter_m = 1e-3 * valueOf(*geometry, "pose_scatter_mm"),
                 scatter_rad = degToRad(valueOf(*geometry, "pose_scatter_deg"));
    target_variance += Eigen::Matrix3d::Identity() * (scatter_m * scatter_m);
    turn_variance += Eigen::Matrix3d::Identity() * (scatter_rad * scatter_rad);
  }
  return ViewUncertainty{std::sqrt(turn_variance.topLeftCorner<2, 2>().trace()), std::sqrt(target_variance.trace())};
}

}  // namespace angio::calibration_records

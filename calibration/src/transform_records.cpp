// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>

#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/hand_eye.hpp"
#include "angio/calibration/view_uncertainty.hpp"
#include "geometry_problem.hpp"
#include "information.hpp"

namespace angio::calibration {
namespace {

// A record of today, still without values.
CalibrationRecord recordOf(const std::string& kind, const std::string& machine,
                           const std::vector<std::string>& input_paths) {
  CalibrationRecord record;
  record.kind = kind;
  record.machine = machine;
  record.date = dateNow();
  for (const std::string& path : input_paths) record.inputs.push_back(hashedInput(path));
  return record;
}

// What the six numbers of a transform are called in a record: "T_dsa_cb_x_mm", ..., "T_dsa_cb_turn_z_deg". As values
// they are its translation and rotation vector, in a covariance a change of its place and a small turn about its
// parent's axes.
std::vector<std::string> transformNumberNames(const std::string& transform) {
  std::vector<std::string> names;
  for (const char* number : {"x_mm", "y_mm", "z_mm", "turn_x_deg", "turn_y_deg", "turn_z_deg"}) {
    names.push_back(transform + "_" + number);
  }
  return names;
}

// A unit of each in SI [m, rad].
Vector6d transformNumberUnits() {
  Vector6d units;
  units << Eigen::Vector3d::Constant(1e-3), Eigen::Vector3d::Constant(degToRad(1));
  return units;
}

// Fills a record's parameters, values, covariance and what can be told apart from transforms and their covariance, six
// rows each [m, rad].
void recordTransforms(CalibrationRecord& record, const std::vector<std::pair<std::string, Pose>>& transforms,
                      const Eigen::MatrixXd& covariance) {
  record.values.resize(6 * transforms.size());
  Eigen::VectorXd per_unit(6 * transforms.size());
  for (std::size_t k = 0; k < transforms.size(); ++k) {
    const std::vector<std::string> names = transformNumberNames(transforms[k].first);
    record.parameters.insert(record.parameters.end(), names.begin(), names.end());
    const std::size_t at = 6 * k;
    const Pose& T = transforms[k].second;
    record.values.segment<6>(at) << T.translation(), logSO3(T.linear());
    record.values.segment<6>(at).array() /= transformNumberUnits().array();
    per_unit.segment<6>(at) = transformNumberUnits().cwiseInverse();
  }
  record.covariance = per_unit.asDiagonal() * covariance * per_unit.asDiagonal();
  recordObservability(record);
}

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

std::pair<std::string, std::string> transformNames(HandEyeSetup setup) {
  if (setup == HandEyeSetup::kEyeInHand) return {"T_hand_camera", "T_base_object"};
  return {"T_base_camera", "T_hand_object"};
}

CalibrationRecord handEyeRecord(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& result) {
  CalibrationRecord record = recordOf("hand_eye", set.machine, set.input_paths);
  const auto [X, Z] = transformNames(set.setup);
  std::vector<std::pair<std::string, Pose>> transforms;
  if (settings.mount == HandEyeMount::kUnknown) transforms.emplace_back(X, result.transforms.X);
  transforms.emplace_back(Z, result.transforms.Z);
  recordTransforms(record, transforms, result.covariance);
  record.residual_unit = "mm";
  record.residual_rms = 1e3 * result.residuals.translation_m;
  if (result.held_out) record.held_out_rms = 1e3 * result.held_out->translation_m;
  for (const HandEyePoseFit& pose : result.poses) {
    record.views.push_back({pose.name, 1, 1e3 * pose.translation_m, pose.outlier});
  }
  return record;
}

CalibrationRecord anatomyRecord(const AnatomyResult& result, const std::string& machine,
                                const std::vector<std::string>& input_paths) {
  CalibrationRecord record = recordOf("registration", machine, input_paths);
  recordTransforms(record, {{"T_dsa_cb", result.T_dsa_cb}}, result.covariance);
  record.residual_unit = "deg";
  double squares = 0, used = 0;
  for (const AnatomyViewFit& view : result.views) {
    record.views.push_back({view.name, 1, radToDeg(view.rotation_rad), view.outlier});
    if (view.outlier) continue;
    squares += std::pow(radToDeg(view.rotation_rad), 2);
    ++used;
  }
  record.residual_rms = std::sqrt(squares / std::max(1.0, used));
  if (result.held_out_rotation_rms_rad) record.held_out_rms = radToDeg(*result.held_out_rotation_rms_rad);
  return record;
}

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

}  // namespace angio::calibration

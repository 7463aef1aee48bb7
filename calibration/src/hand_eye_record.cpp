// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/hand_eye.hpp"
#include "transform_numbers.hpp"

namespace angio {

std::pair<std::string, std::string> transformNames(HandEyeSetup setup) {
  if (setup == HandEyeSetup::kEyeInHand) return {"T_hand_camera", "T_base_object"};
  return {"T_base_camera", "T_hand_object"};
}

CalibrationRecord handEyeRecord(const PoseSet& set, const HandEyeSettings& settings, const HandEyeResult& result) {
  CalibrationRecord record;
  record.kind = "hand_eye";
  record.machine = set.machine;
  record.date = dateNow();
  for (const std::string& path : set.input_paths) record.inputs.push_back(hashedInput(path));

  const auto [X, Z] = transformNames(set.setup);
  std::vector<std::pair<std::string, Pose>> transforms;
  if (settings.mount == HandEyeMount::kUnknown) transforms.emplace_back(X, result.transforms.X);
  transforms.emplace_back(Z, result.transforms.Z);
  const auto size = static_cast<Eigen::Index>(6 * transforms.size());
  record.values.resize(size);
  Eigen::VectorXd per_unit(size);
  for (std::size_t k = 0; k < transforms.size(); ++k) {
    const auto& [name, T] = transforms[k];
    const std::vector<std::string> names = transformNumberNames(name);
    record.parameters.insert(record.parameters.end(), names.begin(), names.end());
    const auto at = static_cast<Eigen::Index>(6 * k);
    record.values.segment<6>(at) = transformNumbers(T);
    per_unit.segment<6>(at) = transformNumberUnits().cwiseInverse();
  }
  record.covariance = per_unit.asDiagonal() * result.covariance * per_unit.asDiagonal();
  const Observability seen = observability(record.parameters, record.covariance);
  record.condition = seen.condition;
  record.weak_directions = seen.weak_directions;

  record.residual_unit = "mm";
  record.residual_rms = 1e3 * result.residuals.translation_m;
  if (result.held_out) record.held_out_rms = 1e3 * result.held_out->translation_m;
  for (const HandEyePoseFit& pose : result.poses) {
    record.views.push_back({pose.name, 1, 1e3 * pose.translation_m, pose.outlier});
  }
  return record;
}

}  // namespace angio

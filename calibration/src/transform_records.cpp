// SPDX-License-Identifier: GPL-2.0-or-later
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "angio/calibration/anatomy_registration.hpp"
#include "angio/calibration/hand_eye.hpp"
#include "angio/calibration_records/transform_numbers.hpp"
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

}  // namespace angio::calibration

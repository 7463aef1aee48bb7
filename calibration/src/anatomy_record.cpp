// SPDX-License-Identifier: GPL-2.0-or-later
#include <cmath>

#include "angio/calibration/anatomy_registration.hpp"
#include "transform_numbers.hpp"

namespace angio {

CalibrationRecord anatomyRecord(const AnatomyResult& result, const std::string& machine,
                                const std::vector<std::string>& input_paths) {
  CalibrationRecord record;
  record.kind = "registration";
  record.machine = machine;
  record.date = dateNow();
  for (const std::string& path : input_paths) record.inputs.push_back(hashedInput(path));
  record.parameters = transformNumberNames("T_dsa_cb");
  record.values = transformNumbers(result.T_dsa_cb);
  const Vector6d per_unit = transformNumberUnits().cwiseInverse();
  record.covariance = per_unit.asDiagonal() * result.covariance * per_unit.asDiagonal();
  const Observability seen = observability(record.parameters, record.covariance);
  record.condition = seen.condition;
  record.weak_directions = seen.weak_directions;
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

}  // namespace angio

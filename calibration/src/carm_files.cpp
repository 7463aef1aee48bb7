// SPDX-License-Identifier: GPL-2.0-or-later
#include "angio/calibration/carm_files.hpp"

#include <algorithm>

#include "angio/base/errors.hpp"
#include "angio/base/formatted.hpp"
#include "angio/geometry/decompositions.hpp"
#include "angio/geometry/se3.hpp"

namespace angio::calibration {

CArmFile carmFileOf(const GeometryInput& input, const GeometryCalibration& found, const std::string& machine) {
  CArmFile file;
  file.carm = found.carm;
  file.machine = machine.empty() ? input.machine : machine;
  file.records = input.records;
  file.records.push_back(found.record);
  CalibrationRecord& record = file.records.back();
  record.machine = file.machine;
  record.date = dateNow();
  record.inputs = input.inputs;
  return file;
}

CArmFile withPatient(CArmFile carm, const Pose& T_dsa_cb, const CalibrationRecord& record, ModelId model_id) {
  carm.T_dsa_cb = T_dsa_cb;
  carm.model_id = model_id;
  if (carm.machine.empty()) carm.machine = record.machine;
  const auto old = std::find_if(carm.records.begin(), carm.records.end(),
                                [&](const CalibrationRecord& other) { return other.kind == record.kind; });
  if (old != carm.records.end()) {
    *old = record;
  } else {
    carm.records.push_back(record);
  }
  return carm;
}

void requirePosesOf(const PoseSet& set, const std::string& carm_path, const CArmFile& carm) {
  if (!carm.machine.empty() && !set.machine.empty() && carm.machine != set.machine) {
    throw InputError(carm_path, "machine", carm.machine, "must be the poses' machine, " + set.machine);
  }
  if (set.setup != HandEyeSetup::kEyeInHand) {
    throw InputError(set.path, "setup", setupName(set.setup), "must be eye_in_hand with --carm");
  }
}

HandEyeResult calibratePatient(const PoseSet& set, const HandEyeSettings& settings) {
  HandEyeResult result = calibrateHandEye(set, settings);
  if (result.covariance.rows() != 12) return result;  // The mount was known.
  constexpr double kCertain = 35;                     // Chi^2 of six dimensions, beyond any doubt.
  Vector6d off;
  off << result.transforms.X.translation(), logSO3(result.transforms.X.linear());
  if (squaredMahalanobis(off, result.covariance.topLeftCorner<6, 6>()) >= kCertain) {
    result.warnings.push_back(
        formatted("the camera sits %.2f deg and %.1f mm off where the C-arm file has it: calibrate the geometry first",
                  radToDeg(off.tail<3>().norm()), 1e3 * off.head<3>().norm()));
  }
  return result;
}

}  // namespace angio::calibration

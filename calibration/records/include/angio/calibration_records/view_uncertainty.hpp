// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>

#include "angio/calibration_records/carm_calibration.hpp"
#include "angio/calibration_records/namespace.hpp"

namespace angio::calibration_records {

/// How far a view may be from what a calibration says: standard deviations, both axes (all three) together.
struct ViewUncertainty {
  double direction_rad = 0;  ///< Of the beam, seen from the anatomy.
  double target_m = 0;       ///< Of the target in the camera.
};

/// What a calibration's records predict of the view at these joints: covariances of the C-arm's geometry and of
/// T_dsa_cb (of a record "hand_eye" or "registration"), and what joints do not explain of a pose. The two count as
/// independent, so that what T_dsa_cb has taken up of the geometry's error counts twice: rather too much than too
/// little. Nothing when the calibration has no record of T_dsa_cb.
std::optional<ViewUncertainty> viewUncertainty(const CArmCalibration& calibration, const CArmJoints& joints,
                                               const Eigen::Vector3d& target_model);

}  // namespace angio::calibration_records

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/base/settings.hpp"
#include "angio/geometry/carm.hpp"

namespace angio {

/// What calibration tells a servo loop: the C-arm's geometry, and how the patient lies.
struct CArmCalibration {
  CArmGeometry carm;

  /// T_dsa_cb: the pre-operative model frame in the patient frame (C-arm axes L, P, S, table at zero).
  Pose T_dsa_cb = Pose::Identity();

  /// Anatomical axes L, P, S from the model's axes: what LAO/RAO and CRA/CAU of the anatomy are counted in. Identity
  /// for a model in DICOM patient coordinates.
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();

  /// Throws InputError when a matrix is no rotation, a length not positive, or a number not finite.
  void check(const std::string& place) const;
};

/// Reads a calibration (YAML): source_isocentre_distance_mm, source_detector_distance_mm, pixel_spacing_mm,
/// image_size_px, T_dsa_cb: {rotation, translation_mm}, and optionally R_lps_model (identity when it is not there).
/// Throws InputError that names file, line or field, value and rule.
CArmCalibration readCArmCalibration(const std::string& path);

/// The same calibration with a wrong T_dsa_cb: turned about `axis_patient` through the point `centre_model`, then
/// shifted. What a loop is tested with.
CArmCalibration miscalibrated(const CArmCalibration& truth, const Eigen::Vector3d& centre_model,
                              const Eigen::Vector3d& axis_patient, double angle_rad,
                              const Eigen::Vector3d& shift_patient_m);

}  // namespace angio

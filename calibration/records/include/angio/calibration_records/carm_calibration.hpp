// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "angio/calibration_records/record.hpp"
#include "angio/geometry/carm.hpp"
#include "angio/vessel/model_id.hpp"

namespace angio::calibration_records {

/// What calibration tells a servo loop: the C-arm's geometry, and how the patient lies.
struct CArmCalibration {
  CArmGeometry carm;

  /// T_dsa_cb: the pre-operative model frame in the patient frame (C-arm axes L, P, S, table at zero).
  Pose T_dsa_cb = Pose::Identity();

  /// Anatomical axes L, P, S from the model's axes: what LAO/RAO and CRA/CAU of the anatomy are counted in. Identity
  /// for a model in DICOM patient coordinates.
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();

  std::string machine;                     ///< Whose calibration it is; empty when nobody said.
  std::vector<CalibrationRecord> records;  ///< How it came about; none for a file that was written by hand.
  ModelId model_id = ModelId::kUnknown;    ///< The tree of T_dsa_cb; kUnknown when nobody said.

  /// Anatomical axes L, P, S in the patient frame.
  Eigen::Matrix3d R_patient_lps() const { return T_dsa_cb.linear() * R_lps_model.transpose(); }

  /// Throws InputError when a matrix is no rotation, a length not positive, or a number not finite.
  void check(const std::string& place) const;
};

/// A C-arm file as it stands: a geometry's calibration alone does not know yet how the patient lies.
struct CArmFile {
  CArmGeometry carm;
  std::optional<Pose> T_dsa_cb;
  Eigen::Matrix3d R_lps_model = Eigen::Matrix3d::Identity();
  std::string machine;
  std::vector<CalibrationRecord> records;
  ModelId model_id = ModelId::kUnknown;
};

/// Reads a C-arm file (YAML): source_isocentre_distance_mm, source_detector_distance_mm, pixel_spacing_mm,
/// image_size_px; optionally machine, T_dsa_cb: {rotation, translation_mm}, model_id of the tree of T_dsa_cb,
/// R_lps_model (identity when it is not there), the records under calibration, and how the C-arm deviates
/// (CArmDeviations; all zero when not there):
///
///     deviations:
///       primary_offset_deg: 0.1            # and secondary_offset_deg, axis_skew_deg, axis_gap_mm, source_right_mm,
///                                          # source_down_mm, detector_turn_deg, detector_roll_deg
///       table: [1, 0, 0, 0, 1, 0, 0, 0, 1] # row-major; the fourth is 0
///       source_detector_offset_mm: 0
///       pixel_aspect: 0
///       principal_point_px: [0, 0]         # from the detector's centre
///       principal_point_slope_px_per_mm: [0, 0]
///       flex:                              # v_mm (3), w_deg (3), waves of primary and secondary, phase_deg
///         - [0.1, 0, 0, 0, 0.02, 0, 1, 0, 90]
///
/// Throws InputError that names file, line or field, value and rule.
CArmFile readCArmFile(const std::string& path);

/// Writes what readCArmFile reads back: angles and lengths to the last digit but one.
void writeCArmFile(const std::string& path, const CArmFile& file);

/// Reads a C-arm file that a loop can be run with. Throws InputError as readCArmFile does, and for a file without
/// T_dsa_cb one that says what makes it.
CArmCalibration readCArmCalibration(const std::string& path);

/// The same for a loop with this tree. Throws InputError for a T_dsa_cb of another tree; one that names no tree passes.
CArmCalibration readCArmCalibration(const std::string& path, const VesselTree& tree);

/// Writes a whole calibration as a C-arm file.
void writeCArmCalibration(const std::string& path, const CArmCalibration& calibration);

/// The same calibration with a wrong T_dsa_cb: turned about `axis_patient` through the point `centre_model`, then
/// shifted. What a loop is tested with.
CArmCalibration miscalibrated(const CArmCalibration& truth, const Eigen::Vector3d& center_model,
                              const Eigen::Vector3d& axis_patient, double angle_rad,
                              const Eigen::Vector3d& shift_patient_m);

}  // namespace angio::calibration_records

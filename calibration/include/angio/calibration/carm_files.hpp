// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/calibration/geometry_calibration.hpp"
#include "angio/calibration/hand_eye.hpp"
#include "angio/calibration_records/carm_calibration.hpp"

namespace angio::calibration {

/// What a settings file may say of a calibration of the C-arm's geometry.
struct GeometryFileSettings {
  BeadDetectionSettings detection;
  GeometrySettings geometry;

  void visit(SettingsVisitor& v) {
    v.section("detection", [this](SettingsVisitor& s) { detection.visit(s); });
    v.section("geometry", [this](SettingsVisitor& s) { geometry.visit(s); });
  }
};

/// The C-arm file of a geometry, with its record of now and those of the camera; T_dsa_cb is for others to add.
///
/// @param machine  Whose C-arm it is; the input's when empty.
CArmFile carmFileOf(const GeometryInput& input, const GeometryCalibration& found, const std::string& machine = {});

/// A C-arm file with T_dsa_cb and its record, in the place of an older one of its kind; the machine is the record's
/// where the file names none. `model_id`: the tree of T_dsa_cb.
CArmFile withPatient(CArmFile carm, const Pose& T_dsa_cb, const CalibrationRecord& record,
                     ModelId model_id = ModelId::kUnknown);

/// Throws InputError that names the file and the key where poses are of another machine than the C-arm's file, or of a
/// camera that does not sit on the hand: T_dsa_cb is not in them.
void requirePosesOf(const PoseSet& set, const std::string& carm_path, const CArmFile& carm);

/// Hand-eye calibration of a C-arm's poses: T_dsa_cb is the result's Z. Warns where the camera sits elsewhere than the
/// C-arm's file has it: a file whose geometry has it elsewhere would use T_dsa_cb wrongly. Throws InputError as
/// calibrateHandEye does.
HandEyeResult calibratePatient(const PoseSet& set, const HandEyeSettings& settings = {});

}  // namespace angio::calibration

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <optional>
#include <string>

#include "angio/geometry/se3.hpp"
#include "angio/io/yaml.hpp"
#include "angio/vessel/model_id.hpp"
#include "angio/vessel/vessel_tree.hpp"

namespace angio::io {

/// Reads nine numbers, row by row, as a rotation; one that is off by rounding is made exact. Throws InputError that
/// names file, line, key and rule; a mirrored one is named as such.
Eigen::Matrix3d readRotation(const YamlField& field);

/// What a pose file holds.
struct PoseFile {
  Pose T_camera_model = Pose::Identity();  ///< Model to camera [m].
  std::optional<Matrix6d> covariance;      ///< [translation; rotation], metres and radians.
  ModelId model_id = ModelId::kUnknown;    ///< The tree that was registered; kUnknown: the file does not say.
};

/// Reads a pose from YAML: `rotation` (9 numbers, row-major), `translation_mm`, optional `covariance` (36 numbers, flat
/// or as six rows), `model_id` (as angio-inspect prints it), `parent: camera` and `child: model`.
///
/// A DICOM file is read as a Spatial Registration, by readDicomRegistration().
///
/// A rotation that is off by rounding (rotationDefect below 1e-3) is made exact. Throws InputError that names file,
/// line, key, value and rule: no rotation, a translation beyond 100 m, a covariance that is not symmetric and positive
/// semidefinite, other frames, unknown keys.
PoseFile readPose(const std::string& path);

/// Reads a `model_id`, as angio-inspect prints it: a whole number.
ModelId readModelId(const YamlField& field);

/// Throws InputError that names the file when its `model_id` is of another tree than this one; kUnknown passes.
/// `remedy` ends the line: what to do where that is meant.
void requireTree(const std::string& path, ModelId model_id, const VesselTree& tree, const std::string& remedy = "");

/// Writes what readPose reads. Throws InputError when the file cannot be written.
void writePose(const std::string& path, const PoseFile& pose);

}  // namespace angio::io

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>
#include <vector>

#include "angio/conventions/world_frame.hpp"
#include "angio/conventions/xray_projection.hpp"
#include "angio/io/xa_files.hpp"

namespace angio::conventions {

/// The names that describeProjection() takes, in the order of its table, and what each is.
struct ConventionName {
  std::string name;
  std::string words;
};
std::vector<ConventionName> conventionNames();

/// A file that says the pose of a model and, by itself or with the other files named here, the camera.
struct ProjectionSource {
  std::string path;
  std::string camera;  ///< Camera file; empty: `path` says the camera itself.
  int frame = 0;       ///< Of an RTK geometry or of a DICOM run, from 0.
  WorldFrame world;    ///< How the model lies where the file has no key for it: .xml and .tfm.
  XaAngleSigns angle_signs = XaAngleSigns::kLaoCra;  ///< Of a DICOM run.
};

/// Reads a pose and a camera of any convention:
///
/// - `.yaml`, `.yml` with the key `convention`: its keys, those that describeProjection() gives;
/// - `.yaml`, `.yml` without it: our pose file, whose camera is `camera`;
/// - `.xml`: RTK's geometry file, one projection of it, on a centred detector with the size and the pixels of `camera`;
/// - `.tfm`: ITK's transform from model to camera, whose camera is `camera`;
/// - a DICOM run: the camera and the pose of a frame by its attributes; the model is the patient, L, P, S about the
///   isocentre.
///
/// Throws InputError that names file, line or field, value and rule.
ConvertedProjection readProjection(const ProjectionSource& source);

/// A projection in the words of a convention: YAML, with what has to be done to our picture for it as a comment. `name`
/// is one of conventionNames(). Throws InputError that lists them for another, and for what the convention needs and
/// the camera does not say.
std::string describeProjection(const std::string& name, const XrayProjection& projection, const WorldFrame& world);

/// Writes the same: as YAML, for "rtk" also as RTK's geometry file (.xml), for the transforms of ITK also as .tfm
/// (without the camera), and for "angio" the pose file that readPose() reads. Throws InputError when the file cannot be
/// written.
void writeProjection(const std::string& path, const std::string& name, const XrayProjection& projection,
                     const WorldFrame& world);

}  // namespace angio::conventions

// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "angio/geometry/se3.hpp"
#include "angio/io/namespace.hpp"
#include "angio/types/model_id.hpp"

namespace angio::io {

/// What a registration says in DICOM.
struct DicomRegistration {
  Pose T_camera_model = Pose::Identity();
  ModelId model_id = ModelId::kUnknown;
  /// Frame of Reference UID of the volume that the tree was taken from, where the tree's points lie in it (L, P, S);
  /// empty: nobody said, and one of its own is made.
  std::string model_frame_uid;
  std::string description;  ///< In words, of which DICOM keeps 64 characters.
};

/// Writes a Spatial Registration object (DICOM PS3.3 A.39, C.20.2) in millimetres. Its own frame of reference is the
/// X-ray camera: origin at the source, x right and y down in the image as seen from the source, z to the detector. It
/// has two items: the run's frame of reference, or its images, by the identity; and the model's, by the pose.
///
/// @param run_path  DICOM run that was registered: patient and study are its; other images have none, and name nobody.
/// Throws InputError that names the file: one that cannot be written, a run that cannot be read, a UID that is none.
void writeDicomRegistration(const std::string& path, const DicomRegistration& registration,
                            const std::string& run_path);

/// Reads what writeDicomRegistration() writes: the pose of the item whose matrix is not the identity, to a micrometre
/// and a microradian. Throws InputError that names file, attribute, value and rule: another kind of object, no such
/// item or several, a matrix that is no rigid transform.
DicomRegistration readDicomRegistration(const std::string& path);

/// Writes a picture (CV_8UC3, blue first) as a Secondary Capture object (DICOM PS3.3 A.8.1), for viewers that show
/// nothing else. The rest as writeDicomRegistration().
void writeSecondaryCapture(const std::string& path, const cv::Mat& picture, const std::string& description,
                           const std::string& run_path);

}  // namespace angio::io

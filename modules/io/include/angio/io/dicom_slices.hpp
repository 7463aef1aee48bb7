// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <string>

#include "angio/io/namespace.hpp"

namespace angio::io {

/// One slice of a tomographic DICOM series (CT, MR) and where it lies in the patient (L, P, S).
struct DicomSlice {
  std::string path;
  std::string series_uid;
  Eigen::Vector3d first_pixel_mm = Eigen::Vector3d::Zero();  ///< Centre of the first pixel [mm].
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();          ///< Direction in which columns follow one another.
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();           ///< Direction in which rows do.
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();      ///< Between columns, between rows [mm].
  cv::Mat values;                                            ///< CV_32FC1, rescaled to the series' unit.
};

/// Reads a DICOM file with one grey frame and its place in the patient. Throws InputError that names file, attribute,
/// value and rule.
DicomSlice readDicomSlice(const std::string& path);

}  // namespace angio::io

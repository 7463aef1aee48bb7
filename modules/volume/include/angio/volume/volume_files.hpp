// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <string>

#include "angio/volume/volume.hpp"

namespace angio::volume {

/// Reads a scalar volume: MetaImage (.mha, .mhd), NIfTI (.nii, .nii.gz), NRRD (.nrrd, .nhdr), or the folder of one
/// DICOM series. Spacing, origin and direction are the file's; NIfTI's RAS axes become LPS, the axes of all volumes
/// here.
///
/// Throws InputError with one line that names file, field, value and rule: not three dimensions, several components
/// (colour, vectors, complex), more than kMaxVoxels, spacing that is not positive, axes that are not at right angles,
/// values that are not finite, slices that are missing or unevenly spaced, and everything that is cut or broken.
Volume readVolume(const std::string& path);

}  // namespace angio::volume
